// The tone of a new alarm.

import { beforeEach, expect, test, vi } from "vitest";
import { AlarmListSchema, Alarm_State as State } from "../../src/gen/robomesh_pb";
import { connect, newPage, publish } from "../console";

let page: typeof import("../../src/panels/alarm-sound");
const tones: number[] = [];

class Audio {
  currentTime = 10;
  destination = {};
  resume = async () => undefined;
  createGain = () => ({ gain: { setValueAtTime: vi.fn(), exponentialRampToValueAtTime: vi.fn() }, connect: vi.fn() });
  createOscillator = () => ({
    frequency: {},
    connect: (to: unknown) => to,
    start: (at: number) => tones.push(at),
    stop: vi.fn(),
  });
}

beforeEach(async () => {
  newPage();
  vi.stubGlobal("AudioContext", Audio);
  page = await import("../../src/panels/alarm-sound");
  await connect();
  const { followAlarms } = await import("../../src/mesh/services/alarms");
  followAlarms();
  tones.length = 0;
  return page.startSound();
});

const report = (...ids: string[]) =>
  publish("robomesh/hall/-/alarms", AlarmListSchema, {
    alarms: ids.map((id) => ({ id, state: State.UNACKNOWLEDGED })),
  });

test("it is silent until a person turns it on in this browser, which plays it once", async () => {
  report();
  report("a");
  expect([page.sound.value, tones]).toEqual([false, []]);
  page.setSound(true);
  expect(tones).toEqual([10, 10.16]);
  vi.resetModules();
  expect((await import("../../src/panels/alarm-sound")).sound.value).toBe(true);
  page.setSound(false);
  report("a", "b");
  expect(tones).toHaveLength(2);
  vi.resetModules();
  expect((await import("../../src/panels/alarm-sound")).sound.value).toBe(false);
});

test("each new alarm sounds; those that the page finds, repeats or loses do not", () => {
  page.sound.value = true;
  report("found");
  expect(tones).toHaveLength(0);
  report("found", "new");
  expect(tones).toHaveLength(2);
  report("new", "found");
  report("new");
  expect(tones).toHaveLength(2);
  report("new", "found");
  expect(tones).toHaveLength(4);
});
