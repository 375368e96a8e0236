// The end of a message: with its motion if it is about one, otherwise after a time.

import { beforeEach, expect, test, vi } from "vitest";
import type { Notice } from "../../../src/mesh/control/control";
import { newPage } from "../../console";
import { use } from "../../shown";

let told: (Notice | null)[];
let newestMotion: typeof import("../../../src/mesh/control/command").newestMotion;
let hook: typeof import("../../../src/mesh/control/notice-expiry").useNoticeExpiry;
const after = (ms: number) => vi.advanceTimersByTimeAsync(ms);
const AT_REST = { running: false, stopped: false, positions: [0, 0] as (number | undefined)[] };
const sent: Notice = { kind: "done", text: "Sent: Home", target: { what: "Home", positions: [1, 2], id: 3n } };
const THERE = { ...AT_REST, positions: [1.001, 2] };
const done = { kind: "done", text: "Done: Home" };
const shownFor = (notice: Notice | null, motion = AT_REST) =>
  use(hook, notice, (each: Notice | null) => void told.push(each), motion);

beforeEach(async () => {
  newPage();
  ({ newestMotion } = await import("../../../src/mesh/control/command"));
  ({ useNoticeExpiry: hook } = await import("../../../src/mesh/control/notice-expiry"));
  told = [];
  newestMotion.value = 3n;
});

test.each([
  ["an outcome", { kind: "done", text: "" }, 8000],
  ["an outcome with a warning", { kind: "done", text: "", warning: "close" }, 30_000],
  ["a refusal", { kind: "refused", text: "" }, 30_000],
] as const)("%s is shown for %o ms", async (_, notice, ms) => {
  shownFor(notice as Notice);
  await after(ms - 10);
  expect(told).toEqual([]);
  await after(20);
  expect(told).toEqual([null]);
});

test.each(["busy", "lost"] as const)("a message of the kind %s ends only with another one", async (kind) => {
  shownFor({ kind, text: "" });
  await after(600_000);
  expect(told).toEqual([]);
});

test("a newer message has its own time", async () => {
  const used = shownFor({ kind: "done", text: "a" });
  await after(7000);
  used.draw({ kind: "done", text: "b" }, (each) => void told.push(each), AT_REST);
  await after(7000);
  expect(told).toEqual([]);
});

async function motionEnds(notice: Notice, end: typeof AT_REST): Promise<(Notice | null)[]> {
  const used = shownFor(notice);
  const tell = (each: Notice | null) => void told.push(each);
  used.draw(notice, tell, { ...AT_REST, running: true });
  await after(60_000);
  expect(told).toEqual([]);
  used.draw(notice, tell, end);
  await after(0);
  return told;
}

test.each([
  ["at its target is done", sent, THERE, done],
  ["with a warning keeps it", { ...sent, warning: "close" }, THERE, { ...done, warning: "close" }],
  ["elsewhere has ended before it", sent, AT_REST, { kind: "refused", text: "Ended before its target: Home" }],
  [
    "whose joints are not known has not arrived",
    sent,
    { ...THERE, positions: [1] },
    { kind: "refused", text: "Ended before its target: Home" },
  ],
  ["by a stop says nothing, the stop does", sent, { ...AT_REST, stopped: true }, null],
])("a motion that ends %s", async (_, notice, end, expected) => {
  expect(await motionEnds(notice as Notice, end)).toEqual([expected]);
});

test("a motion that never seems to run is judged after 1.5 s", async () => {
  shownFor(sent, THERE);
  await after(1400);
  expect(told).toEqual([]);
  await after(200);
  expect(told).toEqual([done]);
});

test.each([
  ["reached its target is done", THERE, done],
  ["did not reach its target has not failed", AT_REST, null],
])("a motion that a later one overtook and that %s", async (_, motion, expected) => {
  newestMotion.value = 4n;
  shownFor(sent, { ...motion, running: true });
  await after(0);
  expect(told).toEqual([expected]);
});
