// Recordings: which are listed, what a change of their names sends, and the player's clock.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import {
  RecordingRequest_Action as Action,
  EventSchema,
  NoteRequestSchema,
  RecordingListSchema,
  RecordingRequestSchema,
  RecordingSchema,
  ReplayRequest_Action as ReplayAction,
  ReplayRequestSchema,
  ReplayStateSchema,
  Event_Severity as Severity,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, publish, read, refuse, requests, say } from "../../console";
import { find, pass, press, texts, type } from "../../hands";
import { show, use } from "../../shown";

type Fields = MessageInitShape<typeof RecordingSchema>;
const HOUR = 3_600_000;
const ago = (hours: number) => timestampFromMs(Date.now() - hours * HOUR);

beforeEach(async () => {
  newPage();
  await connect({ site: "hall", stale: [{ topic: "recording", afterS: 3 }] });
});

async function list(recordings: Fields[], freeBytes = 10n ** 12n, more: object = {}): Promise<void> {
  const { RecordingList } = await import("../../../src/features/recordings/list/recording-list");
  show(<RecordingList />);
  await pass();
  answer(await next(), RecordingListSchema, { recordings, freeBytes, ...more });
  await pass();
}
const RECORDINGS = () => [
  { file: "a.mcap", name: "weld", robot: "arm", start: ago(200), tags: ["test"], duration: { seconds: 60n } },
  { file: "b.mcap", name: "cut", robot: "crane", start: ago(30), note: "Slips", duration: { seconds: 60n } },
  { file: "c.mcap", name: "late", robot: "arm", start: ago(2), duration: { seconds: 60n } },
];
const shown = () => texts("ol[aria-label] > li").map((each) => /weld|cut|late|live/.exec(each)?.[0]);
async function choose(label: string, value: string): Promise<void> {
  const select = find<HTMLSelectElement>(`select[aria-label="${label}"]`);
  select.value = value;
  select.dispatchEvent(new Event("change", { bubbles: true }));
  await pass();
}

test("recordings are listed with the newest first, and filtered by words, robot, tag and time", async () => {
  await list(RECORDINGS());
  expect(shown()).toEqual(["late", "cut", "weld"]);
  type('input[type="search"]', "SLIPS");
  await pass();
  expect([shown(), find(".fleet-head .dim").textContent]).toEqual([["cut"], expect.stringMatching(/1.*3/)]);
  type('input[type="search"]', "");
  await choose("Robot", "arm");
  expect(shown()).toEqual(["late", "weld"]);
  await choose("Time", "week");
  expect(shown()).toEqual(["late"]);
  await choose("Time", "any_time");
  await choose("Tag", "test");
  expect(shown()).toEqual(["weld"]);
});

test("a recording is compared with another one that is chosen next, unless it is cancelled", async () => {
  const topics = [{ topic: "joints", messages: 9n }];
  await list(RECORDINGS().map((each) => ({ ...each, topics })));
  const buttons = [...document.querySelectorAll("button")].filter((each) => each.textContent === "Compare");
  act(() => buttons.at(-1)?.click());
  await pass();
  expect(texts(".compare-line span")).toEqual(["Choose another recording to compare with weld."]);
  const links = () =>
    [...document.querySelectorAll("a")]
      .filter((each) => each.textContent === "Compare with weld")
      .map((each) => each.hash);
  expect(links()).toEqual(["c", "b"].map((second) => `#/recordings/hall/a.mcap/hall/${second}.mcap`));
  press("Cancel");
  await pass();
  expect([texts(".compare-line"), links()]).toEqual([[], []]);
});

test("a recording that runs is in the list while its state is fresh", async () => {
  await list(RECORDINGS().slice(0, 1));
  publish("robomesh/hall/arm/recording", RecordingSchema, {
    file: "d.mcap",
    name: "live",
    robot: "arm",
    start: ago(0),
    open: true,
  });
  await pass(100);
  answer(await next(), RecordingListSchema, { recordings: RECORDINGS().slice(0, 1) });
  await pass();
  expect(shown()).toEqual(["live", "weld"]);
  await pass(3300);
  const again = requests.splice(0);
  for (const request of again) answer(request, RecordingListSchema, { recordings: RECORDINGS().slice(0, 1) });
  document.dispatchEvent(new Event("visibilitychange"));
  await pass(300);
  expect(shown()).toEqual(["weld"]);
});

test.each([
  [10n ** 12n, null],
  [1_999_999_999n, "warning"],
  [1_999_999n, "alarm"],
])("with %i bytes free the recorder's line is marked: %s", async (free, level) => {
  await list([], free);
  expect(document.querySelector(".recorder-line .state")?.className ?? null).toBe(level && `state ${level}`);
  expect(texts(".empty")).toHaveLength(1);
});

test("a recorder that does not answer is named, and its last list stays", async () => {
  await list(RECORDINGS());
  await pass(4000);
  while (!requests.length) {
    say({ case: "answer", value: { id: 0n } } as Parameters<typeof say>[0]);
    await pass(200);
  }
  refuse(await next());
  await pass();
  expect([shown().length, texts(".recorder-line [role=status]").length]).toEqual([3, 1]);
});

const ROW = {
  site: "hall",
  recording: create(RecordingSchema, { file: "a.mcap", name: "weld", note: "n", tags: ["x"], changes: 4 }),
};
test("only changed labels are sent, each based on the change before it", async () => {
  const { saveLabels } = await import("../../../src/features/recordings/list/recording-changes");
  const based = ROW.recording.changes;
  void saveLabels(ROW, { name: "weld 2", note: "n", tags: ["x", "y"] });
  const asked: unknown[] = [];
  for (const changes of [based + 1, based + 2]) {
    const request = await next();
    const { action, file, name, tags, basedOn } = read(request, RecordingRequestSchema);
    asked.push([Action[action], file, name, tags, basedOn]);
    answer(request, RecordingSchema, { changes });
    await pass(0);
    for (const each of requests.splice(0)) if (each.key.includes("/request/")) requests.push(each);
  }
  expect(asked).toEqual([
    ["RENAME", "a.mcap", "weld 2", [], based],
    ["TAG", "a.mcap", "", ["x", "y"], based + 1],
  ]);
});

test("a refused change ends the ones after it", async () => {
  const { saveLabels } = await import("../../../src/features/recordings/list/recording-changes");
  const saved = saveLabels(ROW, { name: "b", note: "m", tags: [] });
  refuse(await next(), "a colleague changed it");
  await expect(saved).rejects.toThrow("a colleague changed it");
  expect(requests).toEqual([]);
});

test("the steps of a program are folded under its start; a refused one, and those before it, are not", async () => {
  const { foldSteps } = await import("../../../src/features/recordings/recorded/fold-steps");
  const event = (at: number, code: string, source = "program", severity = Severity.INFO) => ({
    at,
    event: create(EventSchema, { code, source, severity }),
  });
  const rows = foldSteps([
    event(0, "step"),
    event(1, "program.started", "gateway"),
    event(2, "step"),
    event(3, "note.written", "store"),
    event(4, "step"),
    event(5, "step", "program", Severity.WARNING),
    event(6, "program.started", "gateway"),
    event(7, "step"),
  ]);
  expect(rows.map(({ happened, steps }) => [happened.at, ...steps.map(({ at }) => at)])).toEqual([
    [0],
    [1, 2, 4],
    [3],
    [5],
    [6, 7],
  ]);
});

/** The list of a recording's events, while its player is somewhere [s]. */
async function eventList(list: object[], moment = 0) {
  const { EventList } = await import("../../../src/features/recordings/recorded/event-marks");
  const { signal } = await import("@preact/signals");
  const at = signal(moment);
  const asked = { value: { list: list as never, cut: false }, problem: "" };
  show(<EventList asked={asked} moment={at} seek={() => undefined} robotKey="robomesh/hall/arm" startMs={1e12} />);
  await pass();
  return at;
}
const rows = () => texts(".recorded-events > li");

test("the steps of a run are shown by a press at it, and hidden by the next", async () => {
  const of = { source: "program", severity: Severity.INFO, text: "li asked move" };
  const step = (at: number) => ({ at, event: create(EventSchema, of) });
  const run = { at: 1, event: create(EventSchema, { code: "program.started", text: "li runs square" }) };
  await eventList([run, step(2), step(3)]);
  expect(rows()).toEqual([expect.stringMatching(/li runs square.*2 steps$/)]);
  press("2 steps");
  expect([rows().length, rows()[1]]).toEqual([3, expect.stringContaining("li asked move")]);
  expect(find(".run-steps").getAttribute("aria-expanded")).toBe("true");
  press("2 steps");
  expect(rows()).toHaveLength(1);
});

test("a note on a recording is on the range from where it was begun to the player's position", async () => {
  const { setOperator } = await import("../../../src/mesh/control/control");
  setOperator("wang");
  const at = await eventList([{ at: 1, beside: true, event: create(EventSchema, { text: "starts late" }) }], 0.5);
  expect(rows()).toEqual([expect.stringMatching(/starts late.*Not in the file/i)]);
  press("Note");
  type("form input[aria-label=Text]", "slips");
  press("From here to the player's position");
  at.value = 1.5;
  await pass();
  press("Save note");
  expect(read(await next(), NoteRequestSchema)).toMatchObject({
    text: "slips",
    begin: timestampFromMs(1e12 + 500),
    end: timestampFromMs(1e12 + 1500),
  });
});

test("a note's range is marked on the time line, unless it was withdrawn", async () => {
  const { EventMarks } = await import("../../../src/features/recordings/recorded/event-marks");
  const note = { at: 1, until: 3, event: create(EventSchema, { code: "note.written", note: { text: "slips" } }) };
  show(<EventMarks events={[note, { ...note, withdrawn: true }]} duration={4} seek={() => undefined} />);
  expect(
    [...document.querySelectorAll<HTMLElement>(".note-range")].map(({ style }) => [style.left, style.width]),
  ).toEqual([["25%", "50%"]]);
});

async function openReplay(player = true) {
  const { useOpenReplay } = await import("../../../src/features/recordings/player/open-replay");
  if (player) say({ case: "presence", value: { key: "robomesh/hall/-/alive/player/1", alive: true } });
  await pass();
  const used = use(useOpenReplay, { site: "hall", file: "a.mcap" } as Parameters<typeof useOpenReplay>[0]);
  await pass(0);
  return used;
}
const nextAction = async () => {
  const { key, ...request } = await next();
  return `${key.split("/")[2]} ${ReplayAction[read({ key, ...request }, ReplayRequestSchema).action]}`;
};

test("an opened replay is closed when its page is left", async () => {
  const used = await openReplay();
  answer(await next(), ReplayStateSchema, { robot: "replay-1", durationS: 9 });
  await pass();
  expect(used.result).toMatchObject({ problem: "", replay: { robotKey: "robomesh/hall/replay-1" } });
  used.end();
  expect(await nextAction()).toBe("replay-1 CLOSE");
});

test("a replay that opens after its page was left is closed, too", async () => {
  const used = await openReplay();
  const request = await next();
  used.end();
  answer(request, ReplayStateSchema, { robot: "replay-1" });
  expect(await nextAction()).toBe("replay-1 CLOSE");
});

test("a refused replay says why, and is opened again on request", async () => {
  const used = await openReplay();
  refuse(await next(), "the file is damaged");
  await pass();
  expect([used.result.replay, used.result.problem]).toEqual([null, expect.stringContaining("the file is damaged")]);
  used.result.again();
  await pass();
  expect((await next()).key).toBe("robomesh/hall/-/player/open");
});

test("a site without a player is named only once its presence would have arrived", async () => {
  const used = await openReplay(false);
  await pass(1400);
  expect(used.result.problem).toBe("");
  await pass(200);
  expect([used.result.problem, requests]).toEqual([expect.stringContaining("hall"), []]);
});

test("the player shows the moment, and the time at which it was recorded", async () => {
  const { Replay } = await import("../../../src/mesh/services/replay");
  const { PlaybackControls } = await import("../../../src/features/recordings/player/playback-controls");
  const { timeText } = await import("../../../src/i18n/format");
  const { signal } = await import("@preact/signals");
  const state = create(ReplayStateSchema, { durationS: 100, start: timestampFromMs(1e12) });
  show(<PlaybackControls replay={new Replay("robomesh/hall/replay-1", state)} moment={signal(65)} events={[]} />);
  expect(texts(".transport-time > span")).toEqual([timeText(1e12 + 65_000), "01:05.00 / 01:40.00"]);
});

/** Two replays, the second kept `shift` s ahead; and what the second's player is asked. */
async function pair(
  first: MessageInitShape<typeof ReplayStateSchema>,
  second: typeof first,
  shift: number,
): Promise<string[]> {
  const { Replay } = await import("../../../src/mesh/services/replay");
  const { useSynchronised } = await import("../../../src/features/recordings/player/open-replay");
  const state = (given: typeof first) => create(ReplayStateSchema, { durationS: 100, speed: 1, ...given });
  const [one, other] = [
    new Replay("robomesh/hall/replay-1", state(first)),
    new Replay("robomesh/hall/replay-2", state(second)),
  ];
  const used = use(useSynchronised, one, other, shift);
  await pass(10);
  await vi.advanceTimersByTimeAsync(200);
  used.end();
  return requests.splice(0).map((request) => {
    const { action, positionS, speed } = read(request, ReplayRequestSchema);
    return `${request.key.split("/")[2]} ${ReplayAction[action]} ${Math.round(10 * (action === ReplayAction.SEEK ? positionS : speed)) / 10}`;
  });
}

test.each([
  ["a paused one is put to the same moment", { positionS: 20 }, { positionS: 5 }, 0, ["replay-2 SEEK 20"]],
  ["a shift is kept", { positionS: 20 }, { positionS: 20 }, 3, ["replay-2 SEEK 23"]],
  ["at the same moment nothing is asked", { positionS: 20 }, { positionS: 20 }, 0, []],
  [
    "a small difference of two that play is left",
    { positionS: 20, playing: true },
    { positionS: 20.1, playing: true },
    0,
    [],
  ],
  [
    "at a higher speed a larger one is left",
    { positionS: 20, playing: true, speed: 10 },
    { positionS: 21, playing: true, speed: 10 },
    0,
    [],
  ],
  [
    "a larger one is corrected",
    { positionS: 20, playing: true },
    { positionS: 20.3, playing: true },
    0,
    ["replay-2 SEEK 20.2"],
  ],
  [
    "it plays as the first does, at its speed",
    { positionS: 20, playing: true, speed: 2 },
    { positionS: 20.3 },
    0,
    ["replay-2 SPEED 2", "replay-2 PLAY 0"],
  ],
  [
    "before its start it waits",
    { positionS: 2, playing: true },
    { positionS: 0, playing: true },
    -5,
    ["replay-2 SEEK 0", "replay-2 PAUSE 0"],
  ],
  [
    "after its end it waits",
    { positionS: 50, playing: true },
    { positionS: 30, durationS: 30, playing: true },
    0,
    ["replay-2 PAUSE 0"],
  ],
])("of two recordings, %s", async (_, first, second, shift, asked) => {
  expect(await pair(first, second, shift)).toEqual(asked);
});
