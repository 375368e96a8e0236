// The choice of plotted values.

import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { newPage } from "../console";
import { find, texts, type } from "../hands";
import { show } from "../shown";

const KNOWN = ["weather/wind", "lease/motion", "kinematics/tool/x", "joints/waist/position", "joints/elbow_2/position"];
const choose = vi.fn();
let draw: (chosen: string[], more?: object) => void;

beforeEach(async () => {
  newPage();
  const { ValueChoice } = await import("../../src/panels/value-choice");
  choose.mockReset();
  const place = show(null);
  draw = (chosen, more = {}) =>
    show(<ValueChoice known={KNOWN} chosen={chosen} most={2} choose={choose} {...more} />, place);
});

const turn = (value: string) => act(() => find(`[title="${value}"] input`).click());
const values = () => [...document.querySelectorAll("label[title]")].map((each) => each.getAttribute("title"));

test("values are grouped by topic, the most wanted first, unknown topics by their own name", () => {
  draw([]);
  expect(texts("legend")).toEqual(["Joints", "Tool and distances", "Control", "weather"]);
  expect(values()).toEqual([...KNOWN.slice(3), "kinematics/tool/x", "lease/motion", "weather/wind"]);
});

test.each([
  ["", 5],
  ["  ELBOW  pos", 1],
  ["elbow 2", 1],
  ["joints", 2],
  ["nothing", 0],
])("the filter %o leaves values with each of its words", (filter, count) => {
  draw([]);
  type("input[type=search]", filter);
  expect(values()).toHaveLength(count);
});

test("a value is chosen and taken back, and with the most of them no more can be chosen", () => {
  draw(["lease/motion"]);
  turn("weather/wind");
  turn("lease/motion");
  expect(choose.mock.calls).toEqual([[["lease/motion", "weather/wind"]], [[]]]);
  expect(texts(".values-head span")).toEqual([]);
  draw(["lease/motion", "weather/wind"]);
  expect(texts(".values-head span")).toEqual(["At most 2 at once."]);
  expect(document.querySelectorAll("label input:disabled")).toHaveLength(3);
  turn("weather/wind");
  expect(choose).toHaveBeenLastCalledWith(["lease/motion"]);
});

test("a page names values in its own words, which the filter finds, with their units", () => {
  const unit = (value: string) => (value.startsWith("joints") ? "°" : "");
  draw([], { text: (value: string) => value.toUpperCase().replace("WAIST", "hip"), unit });
  type("input[type=search]", "hip");
  expect(texts("label[title]")).toEqual(["JOINTS/hip/POSITION°"]);
  type("input[type=search]", "wind");
  expect(texts("label[title] span")).toEqual([]);
});
