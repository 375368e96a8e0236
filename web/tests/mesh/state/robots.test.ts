// Which robots the page knows, and what it keeps of each.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { effect } from "@preact/signals";
import { beforeEach, expect, test, vi } from "vitest";
import {
  ControllerState_Activity as Activity,
  ControllerStateSchema,
  LeaseSchema,
  MeshStateSchema,
  AuditEntry_Outcome as Outcome,
} from "../../../src/gen/robomesh_pb";
import { canBe, isReplay } from "../../../src/mesh/state/robot-name";
import { connect, newPage, publish, say, watched } from "../../console";
import { use } from "../../shown";

const ARM = "robomesh/hall/arm";
const soon = () => vi.advanceTimersByTimeAsync(300);
const alive = (key: string, isAlive = true) => say({ case: "presence", value: { key, alive: isAlive } });

beforeEach(async () => {
  newPage();
  await connect();
});

test.each([
  ["hall", "pt600-1", true],
  ["hall", "PT600", false],
  ["ha*l", "arm", false],
  ["hall", "-arm", false],
  ["hall", "a".repeat(63), true],
  ["hall", "a".repeat(64), false],
  ["", "arm", false],
])("the site %s can have a robot %s: %s", (site, robot, can) => {
  expect(canBe({ site, robot })).toBe(can);
});

test("robots are known by a service or by what they publish, never by a person, a site or a replay", async () => {
  const { addKnownRobots, fleetRobots } = await import("../../../src/mesh/state/known-robots");
  for (const place of [
    "hall/b/alive/gateway/1",
    "hall/-/alive/console/2",
    "hall/c/alive/operator/li",
    "hall/replay-1/alive/player/3",
  ])
    alive(`robomesh/${place}`);
  addKnownRobots([`${ARM}/controller`, "robomesh/hall/replay-2/controller"]);
  await soon();
  expect(fleetRobots.value).toEqual([ARM, "robomesh/hall/b"]);
  alive("robomesh/hall/b/alive/gateway/1", false);
  await soon();
  expect(fleetRobots.value).toEqual([ARM]);
  const before = fleetRobots.value;
  addKnownRobots([`${ARM}/lease`]);
  expect(fleetRobots.value).toBe(before);
  expect([isReplay("replay-1"), isReplay("arm")]).toEqual([true, false]);
});

test("of many states of a robot the fleet draws the newest, a few times a second, and only its own tile", async () => {
  const { robotSnapshot, useFleetSnapshots } = await import("../../../src/mesh/state/robot-snapshots");
  const { fleetRobots } = await import("../../../src/mesh/state/known-robots");
  const timers = vi.getTimerCount();
  const used = use(useFleetSnapshots);
  const drawn: number[] = [];
  const others: number[] = [];
  effect(() => void drawn.push(robotSnapshot(ARM).controller.value?.message.rateHz ?? 0));
  effect(() => void others.push(robotSnapshot("robomesh/hall/b").controller.value?.message.rateHz ?? 0));
  for (const rateHz of [1, 2, 3]) publish(`${ARM}/controller`, ControllerStateSchema, { rateHz });
  publish(`${ARM}/lease`, LeaseSchema, { holder: "li" });
  await soon();
  await soon();
  expect(drawn).toEqual([0, 3]);
  expect(others).toEqual([0]);
  expect(robotSnapshot(ARM).lease.value?.message.holder).toBe("li");
  expect(fleetRobots.value).toEqual([ARM]);
  used.end();
  expect([...watched].filter((key) => key.includes("*"))).toEqual([]);
  expect(vi.getTimerCount()).toBe(timers);
});

test("each site's view of its mesh is known by the site", async () => {
  const { useMesh } = await import("../../../src/mesh/state/site-health");
  const used = use(useMesh);
  for (const site of ["hall", "yard"]) publish(`robomesh/${site}/-/mesh`, MeshStateSchema, { site });
  await soon();
  expect([...used.result].map(([site, { message }]) => [site, message.site])).toEqual([
    ["hall", "hall"],
    ["yard", "yard"],
  ]);
});

const at = (second: number) => timestampFromMs(1e12 + 1000 * second);
const entry = (number: bigint, second: number, request = "MOVE_ABSOLUTE", outcome = Outcome.ACCEPTED) =>
  ({ number, request, outcome, timestamp: at(second) }) as never;
const state = (activity: Activity, second: number, more = {}) =>
  ({ activity, timestamp: at(second), ...more }) as never;
const { IDLE, MOVING, HOMING, HOLDING, STOPPED } = Activity;

test.each([
  ["a completed motion has its time", MOVING, state(IDLE, 5.5), { 4: 4.5 }],
  ["also of a HOME", HOMING, state(IDLE, 5.5), { 4: 4.5 }],
  ["a stopped motion has none", MOVING, state(STOPPED, 5.5), {}],
  ["a motion on hold has none", MOVING, state(HOLDING, 5.5), {}],
  ["one that a stop ended has none", MOVING, state(IDLE, 5.5, { stop: {} }), {}],
  ["a robot that rested has none", IDLE, state(IDLE, 5.5), {}],
  ["a robot that is gone has none", MOVING, undefined as never, {}],
])("%s", async (_, first, then, times) => {
  const { useMotionTimes } = await import("../../../src/mesh/state/motion-times");
  const audit = [
    entry(7n, 9),
    entry(6n, 4, "SPEED"),
    entry(5n, 3, "MOVE_ABSOLUTE", Outcome.REFUSED),
    entry(4n, 1),
    entry(3n, 0),
  ];
  const used = use(useMotionTimes, audit, state(first, 2));
  used.draw(audit, then);
  await soon();
  expect(Object.fromEntries([...used.result])).toEqual(times);
});
