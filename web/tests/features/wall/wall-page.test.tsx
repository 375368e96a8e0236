// The wall: which pictures it shows, how a person goes through them, and what a tile says instead of a picture.

import { beforeEach, expect, test, vi } from "vitest";
import {
  ControllerState_Activity as Activity,
  ControllerStateSchema,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
} from "../../../src/gen/robomesh_pb";
import { connect, newPage, publish, say } from "../../console";
import { find, key, pass, press, send, texts } from "../../hands";
import { show } from "../../shown";

const SIZE = { contentRect: { width: 640, height: 360 }, isIntersecting: true };
const gone = vi.fn();
let draw: (...views: [robot: string, view: string][]) => Promise<void>;

beforeEach(async () => {
  newPage();
  const observer = class {
    constructor(private readonly listener: (entries: object[]) => void) {}
    observe() {
      this.listener([SIZE]);
    }
    disconnect() {}
  };
  vi.stubGlobal("IntersectionObserver", observer);
  vi.stubGlobal("ResizeObserver", observer);
  vi.spyOn(location, "replace").mockImplementation(gone.mockReset());
  await connect({ site: "hall", stale: [{ topic: "controller", afterS: 6 }] });
  for (const robot of ["arm", "pt600"])
    say({ case: "presence", value: { key: `robomesh/hall/${robot}/alive/gateway/1`, alive: true } });
  const { WallPage } = await import("../../../src/features/wall/wall-page");
  const place = show(null);
  draw = async (...views) => {
    show(<WallPage chosen={views.map(([robot, view]) => ({ site: "hall", robot, view }))} />, place);
    await pass(300);
  };
});

const tile = (number: number) => `article:nth-child(${number + 1})`;
const state = (more: object) =>
  publish("robomesh/hall/arm/controller", ControllerStateSchema, { link: Link.UP, mode: Mode.REMOTE, ...more });

test("a view of each robot is shown, and what is chosen stands in the address", async () => {
  await draw();
  expect(texts(".wall-line a")).toEqual(["arm", "pt600"]);
  press("Choose pictures");
  send('[aria-label="hall/pt600"] button:last-child', new Event("click"));
  expect(gone.mock.lastCall).toEqual(["#/wall/hall/arm/close/hall/pt600/close/hall/pt600/free"]);
  await draw(["arm", "close"], ["pt600", "close"], ["pt600", "free"]);
  send(`${tile(2)} .wall-remove`, new Event("click"));
  expect(gone.mock.lastCall).toEqual(["#/wall/hall/arm/close/hall/pt600/close"]);
});

test("the arrow keys go from tile to tile, and Enter or a double click to its robot", async () => {
  await draw(["arm", "close"], ["pt600", "close"], ["pt600", "free"]);
  find(tile(0)).focus();
  key(tile(0), "ArrowRight");
  key(tile(1), "ArrowRight");
  expect(document.activeElement).toBe(find(tile(2)));
  key(tile(2), "ArrowRight");
  expect(document.activeElement).toBe(find(tile(2)));
  key(tile(2), "Enter");
  expect(location.hash).toBe("#/hall/pt600");
  send(tile(0), new Event("dblclick", { bubbles: true }));
  expect(location.hash).toBe("#/hall/arm");
});

test("a robot that there is not, a picture that does not come and a replay that ended say so", async () => {
  await draw(["nobody", "close"], ["arm", "front"], ["replay-gone", "close"]);
  expect(texts(".wall-picture .picture-word")).toEqual([
    expect.stringContaining("not on the mesh"),
    expect.stringContaining("Waiting for a picture"),
    expect.stringContaining("This replay has ended"),
  ]);
});

test("a tile gives only the reason of its state", async () => {
  await draw(["arm", "close"]);
  const shown = () => [find(tile(0)).getAttribute("aria-label"), texts(".wall-problem")];
  state({ activity: Activity.FAULT, fault: "axis 2 overheated", linkText: "connected" });
  await pass(300);
  expect(shown()).toEqual([expect.stringMatching(/Fault$/), ["axis 2 overheated"]]);
  state({ activity: Activity.STOPPED, linkText: "connected" });
  await pass(300);
  expect(shown()).toEqual([expect.stringMatching(/Stopped$/), ["The controller has stopped by itself"]]);
  state({ activity: Activity.IDLE, linkText: "connected" });
  await pass(300);
  expect(shown()).toEqual([expect.stringMatching(/Idle$/), []]);
});
