// A joint's target: typed as a number, or set with its handle.

import { create } from "@bufbuild/protobuf";
import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { Description_JointSchema, Description_Joint_Type as Type } from "../../../src/gen/robomesh_pb";
import type { TrackProps } from "../../../src/ui/joints/joint-track";
import { newPage } from "../../console";
import { button, find, key, press, send, texts, type } from "../../hands";
import { show } from "../../shown";

const preview = vi.fn();
const sent = vi.fn();
const wrong = vi.fn();
const WAIST = create(Description_JointSchema, {
  name: "waist",
  title: "Waist",
  type: Type.ROTARY,
  lower: -1,
  upper: 2,
});
const SLIDE = create(Description_JointSchema, { name: "slide", type: Type.PRISMATIC, lower: 0, upper: 0.5 });
const FIELD = ".value-field";

beforeEach(() => {
  newPage();
  for (const each of [preview, sent, wrong]) each.mockReset();
});

type More = { joint?: typeof WAIST; position?: number | undefined; stale?: boolean; enabled?: boolean };
async function value(more: More = {}) {
  const { JointValue } = await import("../../../src/ui/joints/joint-value");
  const props = { joint: WAIST, position: 0.5, stale: false, enabled: true, preview, send: sent, wrong };
  show(<JointValue {...props} {...more} />);
}

test.each<[More, string]>([
  [{ joint: WAIST }, "28.65°"],
  [{ joint: SLIDE }, "500.0mm"],
  [{ position: undefined }, "–°"],
  [{ position: undefined, enabled: false, stale: true }, "–°"],
])("a joint's position is in its unit (%o)", async (more, text) => {
  await value(more);
  expect(texts(".value")).toEqual([text]);
  expect(texts("button")).toHaveLength(more.enabled === false ? 0 : 1);
  expect(find(".value").classList.contains("stale") || find(".value").classList.contains("outdated")).toBe(
    more.stale ?? false,
  );
});

test("a typed target is sent by Enter in SI units", async () => {
  await value();
  press("Type a target of Waist: 28.65°".slice(0, -1));
  expect(document.activeElement).toBe(find(FIELD));
  type(FIELD, "−45,5");
  expect(preview.mock.lastCall?.[0]).toBeCloseTo((-45.5 * Math.PI) / 180);
  key(FIELD, "Enter");
  expect(sent.mock.calls).toEqual([[expect.closeTo((-45.5 * Math.PI) / 180)]]);
  expect([preview.mock.lastCall, texts(FIELD), wrong.mock.calls]).toEqual([[undefined], [], []]);
});

test.each([["-58"], ["115"], [""], ["x"]])("a target beyond a limit, or none, has no preview (%o)", async (text) => {
  await value();
  button("Type a target of Waist: 28.65").click();
  await act(() => undefined);
  type(FIELD, text);
  expect(preview.mock.lastCall).toEqual([undefined]);
});

test("what is no number is named, and not sent", async () => {
  await value();
  press("Type a target of Waist: 28.65");
  type(FIELD, "ten");
  key(FIELD, "Enter");
  expect([sent.mock.calls, wrong.mock.calls]).toEqual([[], [["Not sent: “ten” is no number."]]]);
});

test.each([
  ["Escape", () => key(FIELD, "Escape")],
  ["another focus", () => send(FIELD, new Event("blur"))],
])("%s sends nothing", async (_, end) => {
  await value();
  press("Type a target of Waist: 28.65");
  type(FIELD, "10");
  key(FIELD, "a");
  expect(texts(FIELD)).toHaveLength(1);
  end();
  expect([texts(FIELD), preview.mock.lastCall, sent.mock.calls]).toEqual([[], [undefined], []]);
});

const HANDLE = ".track-handle";
async function track(more: Partial<TrackProps> = {}) {
  const { JointTrack } = await import("../../../src/ui/joints/joint-track");
  const props = {
    label: "Waist",
    lower: -1,
    upper: 3,
    position: 1,
    target: undefined,
    stale: false,
    enabled: true,
    step: 0.1,
  };
  const place = show(null);
  const draw = (changed: Partial<TrackProps> = {}) =>
    show(
      <JointTrack {...props} text={(each) => `${each}!`} preview={preview} send={sent} {...more} {...changed} />,
      place,
    );
  draw();
  return draw;
}
const left = (selector: string) => [...document.querySelectorAll<HTMLElement>(selector)].map((each) => each.style.left);

test("the track shows position, zero and target within the limits", async () => {
  const draw = await track({ target: 9 });
  expect([left(".track-zero"), left(".track-position"), left(HANDLE)]).toEqual([["25%"], ["50%"], ["100%"]]);
  expect([find(HANDLE).getAttribute("aria-valuenow"), find(HANDLE).getAttribute("aria-valuetext")]).toEqual([
    "9",
    "9!",
  ]);
  draw({ target: undefined });
  expect(left(HANDLE)).toEqual(["50%"]);
  draw({ position: undefined, target: undefined, lower: 0 });
  expect([left(".track-zero"), left(".track-position"), left(HANDLE)]).toEqual([[], [], []]);
  draw({ enabled: false });
  expect(left(HANDLE)).toEqual([]);
});

test.each([
  ["ArrowRight", false, 1.1],
  ["ArrowUp", false, 1.1],
  ["ArrowLeft", false, 0.9],
  ["ArrowDown", false, 0.9],
  ["ArrowRight", true, 1.01],
  ["PageUp", false, 2],
  ["PageDown", false, 0],
])("%s sets a target (fine: %s), and only Enter sends it", async (name, shiftKey, target) => {
  await track();
  key(HANDLE, name, { shiftKey });
  expect([preview.mock.calls, sent.mock.calls]).toEqual([[[expect.closeTo(target)]], []]);
  expect(find(HANDLE).classList.contains("unsent")).toBe(true);
  key(HANDLE, "Enter");
  expect(sent.mock.calls).toEqual([[expect.closeTo(target)]]);
  expect(find(HANDLE).classList.contains("unsent")).toBe(false);
});

test("keys go no further than the limits", async () => {
  await track({ position: 2.95 });
  key(HANDLE, "ArrowUp");
  expect(preview.mock.lastCall).toEqual([3]);
});

test.each([
  ["Escape", () => key(HANDLE, "Escape")],
  ["another focus", () => send(HANDLE, new Event("blur"))],
])("%s takes a target back, and Enter then sends nothing", async (_, takeBack) => {
  await track();
  key(HANDLE, "ArrowUp");
  takeBack();
  key(HANDLE, "Enter");
  expect([preview.mock.lastCall, sent.mock.calls, left(HANDLE)]).toEqual([[undefined], [], ["50%"]]);
});

test("other keys do nothing, and a focus that goes by takes nothing back", async () => {
  await track();
  key(HANDLE, "a");
  send(HANDLE, new Event("blur"));
  expect([preview.mock.calls, sent.mock.calls]).toEqual([[], []]);
});
