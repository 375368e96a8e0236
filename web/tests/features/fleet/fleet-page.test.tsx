// The fleet: which robots are shown and in which order, and what a tile says of one that is stale.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ControllerState_Activity as Activity,
  ControllerStateSchema,
  LeaseSchema,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
} from "../../../src/gen/robomesh_pb";
import { connect, newPage, publish } from "../../console";
import { find, pass, press, texts, type } from "../../hands";
import { show } from "../../shown";

let seen: (entries: object[]) => void;
beforeEach(async () => {
  newPage();
  vi.stubGlobal(
    "IntersectionObserver",
    class {
      constructor(listener: typeof seen) {
        seen = listener;
      }
      observe(target: Element) {
        seen([{ target, isIntersecting: true }]);
      }
      unobserve() {}
    },
  );
  // Pictures and arms need WebGL.
  vi.doMock("../../../src/features/fleet/tile-pictures", () => ({
    drawTile: () => () => undefined,
    showTile: () => () => undefined,
  }));
  await connect({
    site: "hall",
    stale: [
      { topic: "controller", afterS: 6 },
      { topic: "lease", afterS: 3 },
    ],
  });
  const { FleetPage } = await import("../../../src/features/fleet/fleet-page");
  show(<FleetPage />);
  await pass(1600);
});

const READY = { link: Link.UP, mode: Mode.REMOTE, activity: Activity.IDLE };
function send(name: string, state: MessageInitShape<typeof ControllerStateSchema> = READY): void {
  publish(`robomesh/${name}/controller`, ControllerStateSchema, state);
}
const shown = () =>
  [...document.querySelectorAll("[data-robot]")].map((each) =>
    each.getAttribute("data-robot")?.slice("robomesh/".length),
  );
const tile = (name: string) => find(`[data-robot="robomesh/${name}"]`);
async function choose(label: string, value: string): Promise<void> {
  const select = find<HTMLSelectElement>(`select[aria-label="${label}"]`);
  select.value = value;
  select.dispatchEvent(new Event("change", { bubbles: true }));
  await pass(1100);
}
async function three(): Promise<void> {
  for (let i = 0; i < 5; i++) {
    send("hall/b");
    send("hall/c", { link: Link.DOWN });
    send("yard/a");
    await pass(300);
  }
}

test("an empty fleet says so once live robots would have published", () => {
  expect(texts(".empty")).toHaveLength(1);
});

test("robots are shown by site and name, and by urgency if that is chosen", async () => {
  await three();
  expect([shown(), texts("h2")]).toEqual([
    ["hall/b", "hall/c", "yard/a"],
    ["hall", "yard"],
  ]);
  await choose("Order", "by_urgency");
  expect(shown()[0]).toBe("hall/c");
});

test("filters by name, site and state show what they left out, and are cleared by one press", async () => {
  await three();
  expect(texts(".fleet-head .dim")[0]).toMatch(/^3 /);
  await choose("State", "faulty");
  const faulty = shown();
  await choose("State", "needs_look");
  expect(faulty).toEqual(
    [...document.querySelectorAll(".tile.alarm")].map((each) => each.getAttribute("data-robot")?.slice(9)),
  );
  expect(shown()).toEqual(["hall/c"]);
  await choose("Site", "yard");
  expect([shown(), texts(".empty p")[0]]).toEqual([[], expect.stringContaining("3")]);
  await press("Clear the filter");
  await pass(1100);
  expect(shown()).toHaveLength(3);
  type('input[type="search"]', "HALL/B");
  await pass(1100);
  expect(shown()).toEqual(["hall/b"]);
  type('input[type="search"]', "");
});

test("a tile has the reason of its robot's state and its marks, and leads to it", async () => {
  for (let i = 0; i < 5; i++) {
    send("hall/b", { ...READY, readOnly: true, capabilities: { slowHz: 2 } });
    send("hall/c", { ...READY, activity: Activity.FAULT, fault: "axis 2: following error" });
    publish("robomesh/hall/b/lease", LeaseSchema, {});
    await pass(300);
  }
  expect(tile("hall/b").textContent).toMatch(/read-only.*slow: 2\/s.*Nobody is in control/);
  expect(tile("hall/c").textContent).toContain("axis 2: following error");
  expect(tile("hall/c").textContent).not.toMatch(/read-only|slow: /);
  expect(tile("hall/c").getAttribute("href")).toBe("#/hall/c");
});

test("a tile says who has control while that is known, and a stale robot is never shown as live", async () => {
  send("hall/b");
  publish("robomesh/hall/b/lease", LeaseSchema, { holder: "wang", since: timestampFromMs(1e12) });
  for (let i = 0; i < 4; i++) await pass(400);
  const fresh = tile("hall/b");
  expect(fresh.textContent).toContain("wang");
  expect(fresh.querySelector(".age")).toBeNull();
  for (let i = 0; i < 10; i++) await pass(700);
  expect(tile("hall/b").textContent).not.toContain("wang");
  expect(tile("hall/b").querySelector(".age")?.textContent).toMatch(/\d/);
});
