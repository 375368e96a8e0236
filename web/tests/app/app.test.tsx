// The frame of every page: where STOP goes, the way to another robot, and addresses that name no robot.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ControllerState_Activity as Activity,
  AlarmListSchema,
  ControllerStateSchema,
  DescriptionSchema,
  LeaseRequest_Action as LeaseAction,
  LeaseRequestSchema,
  ControllerState_Link as Link,
  ControllerState_Mode as Mode,
  ReplayStateSchema,
} from "../../src/gen/robomesh_pb";
import { connect, newPage, publish, read, requests, say, stayConnected, watched } from "../console";
import { find, key, press, send, texts, type } from "../hands";
import { nextTo, takeControl } from "../mesh/control/operator";
import { show } from "../shown";

const STALE = [
  { topic: "controller", afterS: 6 },
  { topic: "alarms", afterS: 6 },
  { topic: "replay", afterS: 6 },
];
let app: typeof import("../../src/app/app");

beforeEach(async () => {
  newPage();
  location.hash = "#/";
  const observer = class {
    observe() {}
    unobserve() {}
    disconnect() {}
  };
  vi.stubGlobal("IntersectionObserver", observer);
  vi.stubGlobal("ResizeObserver", observer);
  app = await import("../../src/app/app");
});

/** Let time pass in which the console goes on sending, and pages are loaded. */
async function pass(ms: number): Promise<void> {
  await act(() => stayConnected(0.1));
  await vi.dynamicImportSettled();
  await act(() => stayConnected(ms / 1000));
}

/** Open the page at a hash, before a site of robots. */
async function open(hash: string, robots = ["hall/arm", "hall/pt600"]): Promise<void> {
  await go(hash);
  await connect({ site: "hall", stale: STALE });
  for (const robot of robots)
    say({ case: "presence", value: { key: `robomesh/${robot}/alive/gateway/1`, alive: true } });
  show(<app.App />);
  await pass(1000);
}
async function go(hash: string): Promise<void> {
  location.hash = hash;
  dispatchEvent(new Event("hashchange"));
  await pass(1000);
}
const state = (robot: string, activity = Activity.IDLE) =>
  publish(`robomesh/${robot}/controller`, ControllerStateSchema, { link: Link.UP, mode: Mode.REMOTE, activity });
/** The two robots that were asked to stop. */
const stopped = async () =>
  [await nextTo("/stop"), await nextTo("/stop")].map((request) => request.key.split("/")[2]).sort();
const stop = () => find<HTMLButtonElement>("button.stop");

test("the choice of a program says where it is, and its STOP names the whole fleet", async () => {
  await open("#/program");
  expect(texts(".crumbs > *").map((each) => each.replace(/\s+/g, " "))).toEqual(["Go to a robot", "/", "Program"]);
  expect([stop().textContent, stop().disabled, stop().title]).toEqual([
    "Stop request: all",
    false,
    expect.stringMatching(/^Asks all robots of the fleet/),
  ]);
  stop().click();
  expect(await stopped()).toEqual(["arm", "pt600"]);
});

test.each([
  ["#/Hall/arm", "arm at Hall"],
  ["#/hall/a%2Fb", "a/b at hall"],
  ["#/hall/%zz", "%zz at hall"],
])("the address %s can be no robot's, which is said without asking for it", async (hash, robot) => {
  await open(hash);
  expect(texts("h1")).toEqual([`There is no robot ${robot}.`]);
  expect(texts("main li a")).toEqual(["hall / arm", "hall / pt600"]);
  expect([stop().textContent, stop().disabled]).toEqual(["Stop request: all", false]);
  // The console closes the connection of a page that subscribes to an invalid key.
  const [name, site] = robot.split(" at ");
  expect([...watched].filter((key) => key.includes(`${site}/${name}`))).toEqual([]);
});

test("of a robot that there is not nothing is shown before that is said", async () => {
  await open("#/");
  const seen = new Set<string>();
  const watching = new MutationObserver(() => {
    for (const each of [".control", ".step", ".scene", ".missing h1"]) if (document.querySelector(each)) seen.add(each);
  });
  watching.observe(document.body, { childList: true, subtree: true });
  for (const hash of ["#/hall/nowhere", "#/program/hall/nowhere"]) {
    await go(hash);
    expect(texts("h1")).toEqual(["There is no robot nowhere at hall."]);
  }
  expect([...seen]).toEqual([".missing h1"]);
  watching.disconnect();
});

test("another robot's page takes control back from this one, and the same robot's program does not", async () => {
  await go("#/hall/arm");
  await takeControl("robomesh/hall/arm");
  for (const robot of ["arm", "pt600"])
    say({ case: "presence", value: { key: `robomesh/hall/${robot}/alive/gateway/1`, alive: true } });
  show(<app.App />);
  await pass(300);
  const released = () =>
    requests.flatMap((each) => (each.key.includes("/lease/") ? [read(each, LeaseRequestSchema).action] : []));
  await go("#/program/hall/arm");
  expect(released()).not.toContain(LeaseAction.RELEASE);
  await go("#/hall/pt600");
  expect(released()).toContain(LeaseAction.RELEASE);
});

const switcher = "[role=dialog] input";
const options = () => texts("[role=option]");
const openSwitcher = async () => {
  send(".switcher-button", new Event("click"));
  await pass(300);
};

test("the bar leads to another robot by a few letters, and from a program to that robot's program", async () => {
  await open("#/hall/arm");
  await openSwitcher();
  state("hall/arm");
  state("hall/pt600", Activity.MOVING);
  await pass(1000);
  expect(options()).toEqual(["armIdle", "pt600Moving"]);
  expect(document.activeElement).toBe(find(switcher));
  key(switcher, "ArrowDown");
  expect(find("[aria-selected=true]").textContent).toMatch(/^pt600/);
  key(switcher, "Escape");
  expect([options(), document.activeElement]).toEqual([[], find(".switcher-button")]);
  await openSwitcher();
  type(switcher, "hall pt");
  expect(options()).toHaveLength(1);
  key(switcher, "Enter");
  expect(location.hash).toBe("#/hall/pt600");
  await go("#/program/hall/arm");
  await openSwitcher();
  type(switcher, "pt6");
  key(switcher, "Enter");
  expect(location.hash).toBe("#/program/hall/pt600");
});

test("one of many robots is found by its number, a page of the list at a time", async () => {
  const number = (each: number) => String(each).padStart(3, "0");
  await open(
    "#/yard/r007",
    Array.from({ length: 200 }, (_, each) => `yard/r${number(each)}`),
  );
  await openSwitcher();
  expect(options()).toHaveLength(200);
  type(switcher, "yard 19");
  expect(options().map((each) => each.slice(0, 4))).toEqual(
    [19, 119, ...Array.from({ length: 10 }, (_, each) => 190 + each)].map((each) => `r${number(each)}`),
  );
  key(switcher, "PageDown");
  key(switcher, "Enter");
  expect(location.hash).toBe("#/yard/r196");
});

test("the badge of a silent watch does not say that there are no alarms", async () => {
  await open("#/");
  expect(texts(".alarm-badge .unseen")).not.toEqual([expect.stringContaining("No unacknowledged alarm")]);
  const now = { timestamp: timestampFromMs(Date.now()) };
  publish("robomesh/yard/-/alarms", AlarmListSchema, { site: "yard", ...now });
  await pass(500);
  expect(texts(".alarm-badge .unseen")).toEqual(["No unacknowledged alarm"]);
  await pass(7000);
  expect(texts(".alarm-badge .unseen")).toEqual([expect.stringContaining("The watch of yard is silent")]);
  expect(find(".alarm-badge").textContent).toContain("alarms stale");
});

test("a replay is no robot of the fleet, its page offers no command, and STOP stays that of the robots", async () => {
  await open("#/");
  const replay = { robot: "replay-1", ofRobot: "pt600", durationS: 9, start: timestampFromMs(1e12) };
  const report = async () => {
    publish("robomesh/hall/replay-1/replay", ReplayStateSchema, replay);
    publish("robomesh/hall/replay-1/description", DescriptionSchema, { replay: { robot: "pt600" } });
    await pass(500);
  };
  await report();
  expect([texts(".replay-line"), texts("[data-robot] strong")]).toEqual([
    [expect.stringContaining("replay of pt600")],
    ["arm", "pt600"],
  ]);
  await go("#/hall/replay-1");
  await report();
  expect(texts(".headline")).toEqual([expect.stringContaining("replay of pt600")]);
  expect(texts("section.transport")).toHaveLength(1);
  expect(texts("button").filter((each) => /control|Home|Hold|^[+−]/.test(each))).toEqual([]);
  expect(stop().textContent).toBe("Stop request: all");
  stop().click();
  expect(await stopped()).toEqual(["arm", "pt600"]);
});

test("a page whose part is no longer there says so, and is loaded again", async () => {
  vi.doMock("../../src/features/wall/wall-page", () => {
    throw new Error("gone");
  });
  vi.resetModules();
  app = await import("../../src/app/app");
  await open("#/wall");
  expect(texts("main [role=alert] p")).toEqual([expect.stringMatching(/^This page could not be loaded/)]);
  const reload = vi.spyOn(location, "reload").mockReturnValue();
  press("Load again");
  expect(reload).toHaveBeenCalledOnce();
  vi.doUnmock("../../src/features/wall/wall-page");
});
