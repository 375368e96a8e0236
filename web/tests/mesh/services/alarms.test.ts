// Alarms of every site: their order, their counts, and actions on them.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test, vi } from "vitest";
import {
  AlarmListSchema,
  AlarmRequestSchema,
  Alarm_Priority as Priority,
  Alarm_State as State,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, publish, read, refuse, say } from "../../console";

let page: typeof import("../../../src/mesh/services/alarms");
const { UNACKNOWLEDGED, ACKNOWLEDGED, RETURNED, SHELVED } = State;
const { LOW, HIGH, CRITICAL } = Priority;
const alarm = (id: string, priority = LOW, state = UNACKNOWLEDGED, second = 0, more = {}) => ({
  id,
  priority,
  state,
  robot: "arm",
  since: timestampFromMs(1e12 + 1000 * second),
  ...more,
});
const list = (site: string, ...alarms: ReturnType<typeof alarm>[]) =>
  publish(`robomesh/${site}/-/alarms`, AlarmListSchema, { alarms, site });
const names = (alarms = page.alarms.value) => alarms.map(page.nameOf).join(" ");

beforeEach(async () => {
  newPage();
  page = await import("../../../src/mesh/services/alarms");
  await connect({ stale: [{ topic: "alarms", afterS: 5 }] } as never);
  page.followAlarms();
});

test("a site's list replaces its last one, and an alarm belongs to the site that reports it", () => {
  expect(page.anyWatch.value).toBe(false);
  list("hall", alarm("a"), alarm("b"));
  list("yard", alarm("a", LOW, UNACKNOWLEDGED, 0, { site: "far" }));
  list("hall", alarm("a"));
  expect([names(), page.anyWatch.value]).toEqual(["hall/a far/a", true]);
});

const MIXED = [
  alarm("returned", HIGH, RETURNED, 9),
  alarm("old", HIGH, UNACKNOWLEDGED, 1),
  alarm("again", HIGH, UNACKNOWLEDGED, 2, { last: timestampFromMs(1e12 + 8000) }),
  alarm("low", LOW, UNACKNOWLEDGED, 5),
  alarm("seen", CRITICAL, ACKNOWLEDGED, 3),
  alarm("shelved", CRITICAL, SHELVED, 7),
];
test.each([
  ["order_priority", "seen shelved again old returned low"],
  ["order_state", "again old low returned seen shelved"],
  ["order_time", "returned again shelved low seen old"],
] as const)("%s: %s", (order, ids) => {
  list("hall", ...MIXED);
  expect(
    page
      .sorted(page.alarms.value, order)
      .map(({ id }) => id)
      .join(" "),
  ).toBe(ids);
  expect(page.lastMs({} as never)).toBe(0);
});

test("of a robot only alarms that are active and not shelved count, in the bar those that nobody acknowledged", () => {
  list("hall", ...MIXED);
  expect(names(page.alarmsOf.value.get("robomesh/hall/arm"))).toBe("hall/seen hall/again hall/old hall/low");
  expect(page.counts.value).toEqual([
    { priority: HIGH, count: 3 },
    { priority: LOW, count: 1 },
  ]);
});

test("a site whose watch is silent is named, not taken for one without alarms", async () => {
  list("hall", alarm("a"));
  list("yard");
  await vi.advanceTimersByTimeAsync(4000);
  list("yard");
  expect(page.silentSites()).toEqual([]);
  await vi.advanceTimersByTimeAsync(1300);
  expect(page.silentSites()).toEqual(["hall"]);
});

test("each site is asked about its own alarms, in the operator's name, and the first refusal is said", async () => {
  const { setOperator } = await import("../../../src/mesh/control/control");
  setOperator(" li ");
  list("hall", alarm("a"), alarm("b"));
  list("yard", alarm("c"));
  const done = page.act(page.alarms.value, page.Action.SHELVE, { reason: "paint", shelveS: 60 });
  const [first, second] = [await next(), await next()];
  expect([first.key, second.key]).toEqual(["robomesh/hall/-/alarms/request/li", "robomesh/yard/-/alarms/request/li"]);
  expect(read(first, AlarmRequestSchema)).toMatchObject({ ids: ["a", "b"], action: 2, reason: "paint", shelveS: 60 });
  answer(first, AlarmListSchema, {});
  refuse(second, "no such alarm");
  await expect(done).rejects.toThrow("no such alarm");
  say({ case: "hello", value: { operator: "li.hall" } } as never);
  expect(page.asker.value).toBe("li.hall");
  const quiet = page.act(page.alarms.value.slice(0, 1), page.Action.ACKNOWLEDGE);
  answer(await next(), AlarmListSchema, {});
  await quiet;
});
