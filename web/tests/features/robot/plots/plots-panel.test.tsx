// Plots as a person sees them: legend, pause, zoom, and what of the past is missing. uPlot draws nothing here.

import { create } from "@bufbuild/protobuf";
import { useState } from "preact/hooks";
import { beforeEach, expect, test, vi } from "vitest";
import { JointStatesSchema } from "../../../../src/gen/foxglove/JointStates_pb";
import { Description_Joint_Type, DescriptionSchema, SeriesAnswerSchema } from "../../../../src/gen/robomesh_pb";
import type { Plot } from "../../../../src/ui/page/layout";
import { answer, connect, newPage, next, publish, say, watched } from "../../../console";
import { button, find, pass, press, texts } from "../../../hands";
import { ARM } from "../../../recorded";
import { hide, show } from "../../../shown";

type Values = (null | number | undefined)[];

/** Options that the page gives uPlot. */
interface Options {
  scales: { x: { range: () => [number, number] } } & Record<string, { range: (_: null, ...of: unknown[]) => number[] }>;
  axes: { values: (_: unknown, at: number[]) => string[]; splits?: (self: unknown) => number[] }[];
  hooks: Record<"setCursor" | "setSelect", [(plot: unknown) => void]>;
}

/** A uPlot that keeps what it is given. */
class Drawing {
  readonly over = document.createElement("div");
  readonly cursor = { left: -10 };
  readonly select = { left: 0, width: 0, top: 0, height: 0 };
  readonly width = 720;
  data: Values[] = [];
  constructor(readonly options: Options) {
    drawings.push(this);
  }
  setData(data: Values[]) {
    this.data = structuredClone(data);
  }
  setSize() {}
  setSelect() {}
  destroy() {}
  /** 10 px are a second. */
  posToVal = (left: number) => this.shown()[0] + left / 10;
  shown = () => this.options.scales.x.range();
  call = (hook: "setCursor" | "setSelect") => pressed(() => this.options.hooks[hook][0](this));
  axisTexts(index: number, given?: number[]) {
    const axis = this.options.axes[index];
    return axis?.values(this, given ?? axis.splits?.(this) ?? []);
  }
  range = (unit: string, ...of: unknown[]) => this.options.scales[`unit ${unit}`]?.range(null, ...of);
}
const drawings: Drawing[] = [];
vi.mock("uplot", () => ({ default: Drawing }));
const pressed = async (act: () => void) => {
  act();
  await pass(10);
};
const drawing = () => drawings.at(-1) as Drawing;
const seen = () => drawing().data[1]?.findLast((each) => typeof each === "number");

const WAIST = "joints/waist/position";
const RAIL = "joints/rail/position";
const DESCRIPTION = create(DescriptionSchema, {
  joints: [
    { name: "waist", title: "Waist", titleZh: "腰部" },
    { name: "rail", type: Description_Joint_Type.PRISMATIC },
  ],
});
let now: () => number;
let stored: readonly Plot[];

beforeEach(async () => {
  newPage();
  vi.spyOn(HTMLElement.prototype, "clientWidth", "get").mockReturnValue(720);
  vi.stubGlobal(
    "ResizeObserver",
    class {
      observe() {}
      disconnect() {}
    },
  );
  drawings.length = 0;
  now = (await import("../../../../src/mesh/console/age-clock")).ageClock;
  await connect({
    site: "test",
    values: [{ topic: "joints", schema: "foxglove.JointStates" }],
    stale: [{ topic: "joints", afterS: 0.5 }],
  });
});

async function draw(...plots: Plot[]): Promise<() => void> {
  const { PlotsPanel } = await import("../../../../src/features/robot/plots/plots-panel");
  const Page = () => {
    const [all, set] = useState<readonly Plot[]>(plots);
    stored = all;
    return <PlotsPanel robotKey={ARM} description={DESCRIPTION} plots={all} setPlots={set} />;
  };
  const place = show(<Page />);
  await pass();
  return () => hide(place);
}
async function send(waist: number, rail = 0, ms = 300): Promise<void> {
  const joints = [
    { name: "waist", position: waist },
    { name: "rail", position: rail },
  ];
  publish(`${ARM}/joints`, JointStatesSchema, { joints });
  await pass(ms);
}
const ONE: Plot = { fields: [WAIST], seconds: 60 };

test("a page that shows no plot any more watches nothing of it", async () => {
  const leave = await draw(ONE);
  expect([...watched]).toEqual([`${ARM}/joints`]);
  leave();
  expect([...watched]).toEqual([]);
});

test("the legend shows each value in its unit until it is stale", async () => {
  await draw({ fields: [WAIST, RAIL, "joints/x/position"], seconds: 60 });
  expect(texts(".legend li")).toEqual(["position", "Waistnot sent", "railnot sent", "xnot sent"]);
  await send(-Math.PI / 2, 0.25);
  expect(texts(".legend .figure")).toEqual(["−90.00°", "250.0\u202fmm", "not sent"]);
  await pass(500);
  expect(texts(".legend .figure")).toEqual(["–", "–", "not sent"]);
  expect(texts(".legend .absent")).toHaveLength(2);
});

test("in Chinese the legend has the joints' Chinese titles", async () => {
  const { showFirstLanguage } = await import("../../../../src/i18n/texts");
  await draw(ONE);
  await showFirstLanguage("zh");
  await pass(300);
  expect(texts(".legend li")[0]).toContain("腰部");
});

test("a plot without fields of its own shows the positions of all joints", async () => {
  await draw({ fields: null, seconds: 10 });
  expect(texts(".legend li").slice(1)).toEqual(["Waistnot sent", "railnot sent"]);
});

test("a live plot shows its last seconds, and waits in words until a value arrives", async () => {
  await draw({ fields: [WAIST], seconds: 10 });
  expect(find(".plot").textContent).toBe("The plot begins with the first live value.");
  await send(1);
  const [from, to] = drawing().shown();
  expect([to - from, now() / 1000 - to]).toEqual([10, expect.closeTo(0, 0)]);
  expect([seen(), find(".plot").textContent]).toEqual([expect.closeTo(57.2958), ""]);
});

test("a level curve is not drawn again; a change is", async () => {
  await draw({ fields: [WAIST], seconds: 10 });
  for (let i = 0; i < 40; i++) await send(1);
  const drawn = () => Number(find(".plot").dataset.drawn);
  const before = drawn();
  for (let i = 0; i < 4; i++) await send(1);
  expect(drawn()).toBe(before);
  await send(1.1);
  await send(1.1);
  expect(drawn()).toBeGreaterThan(before);
});

test("a paused plot and its legend stay as they were, and say since when; live again they go on", async () => {
  await draw(ONE);
  await send(1);
  await press("Pause");
  await pass(10);
  const before = drawing().shown();
  await send(2, 0, 1000);
  expect([drawing().shown(), seen(), texts(".legend .figure")]).toEqual([before, expect.closeTo(57.2958), ["57.30°"]]);
  expect(texts(".warned")[0]).toMatch(/^Paused at \d\d:\d\d:\d\d[+-]\d\d:\d\d$/);
  await press("Pause");
  await send(2);
  expect([seen(), texts(".legend .figure"), texts(".warned")]).toEqual([expect.closeTo(114.5916), ["114.59°"], []]);
});

test("dragging over a plot zooms and pauses it; a click does not", async () => {
  await draw(ONE);
  await send(1);
  const plot = drawing();
  const [from] = plot.shown();
  Object.assign(plot.select, { left: 100, width: 5 });
  await plot.call("setSelect");
  expect(texts(".warned")).toEqual([]);
  Object.assign(plot.select, { left: 100, width: 200 });
  await plot.call("setSelect");
  const [left, right] = plot.shown();
  expect([left - from, right - from, texts(".warned").length]).toEqual([
    expect.closeTo(10, 0),
    expect.closeTo(30, 0),
    1,
  ]);
  await press("Whole range");
  await pass(10);
  expect(plot.shown()[1] - plot.shown()[0]).toBe(60);
});

test("the shortest zoom is 0.2 s, and a double click ends it", async () => {
  await draw(ONE);
  const plot = drawing();
  plot.posToVal = (left: number) => left / 1000;
  Object.assign(plot.select, { left: 100, width: 8 });
  await plot.call("setSelect");
  expect(plot.shown()).toEqual([expect.closeTo(0.004), expect.closeTo(0.204)]);
  await pressed(() => plot.over.dispatchEvent(new Event("dblclick")));
  expect(plot.shown()[1] - plot.shown()[0]).toBe(60);
});

test("the legend shows the values under the pointer", async () => {
  await draw(ONE);
  await send(1);
  await send(2);
  const plot = drawing();
  plot.cursor.left = 597;
  await plot.call("setCursor");
  await pass(250);
  expect(texts(".legend .figure")).toEqual(["57.30°"]);
  plot.cursor.left = -10;
  await plot.call("setCursor");
  await pass(250);
  expect(texts(".legend .figure")).toEqual(["–"]);
});

test("the time axis counts back from now; that of a longer or paused plot has times of day", async () => {
  await draw(ONE);
  expect(drawing().axisTexts(0)).toEqual(["−60 s", "−50 s", "−40 s", "−30 s", "−20 s", "−10 s", "0 s"]);
  await press("Pause");
  await pass(10);
  const paused = drawing().axisTexts(0);
  expect(paused).toHaveLength(6);
  for (const text of paused ?? []) expect(text).toMatch(/^\d\d:\d\d:[0-5]0$/);
  await draw({ fields: [WAIST], seconds: 3600 });
  for (const text of drawing().axisTexts(0) ?? []) expect(text).toMatch(/^\d\d:[0-5]0$/);
});

test("an axis has its unit, and noise does not fill it", async () => {
  await draw({ fields: [WAIST, RAIL], seconds: 60 });
  const plot = drawing();
  expect(plot.axisTexts(1, [-10, 0.5])).toEqual(["−10°", "0.5°"]);
  expect(plot.axisTexts(2, [-10, 1e5])).toEqual(["−10\u202fmm", "1.0e+5\u202fmm"]);
  expect(plot.range("°", null, null)).toEqual([-90, 90]);
  expect(plot.range("°", 1, 1.001)).toEqual([-4, expect.closeTo(6.001)]);
  expect(plot.range("°", -100, 100)).toEqual([-116, 116]);
});

test.each([
  [[], [[0, 60]]],
  [[[0, 60]], []],
  [
    [
      [10, 20],
      [21, 30],
    ],
    [
      [0, 10],
      [30, 60],
    ],
  ],
  [
    [
      [30, 90],
      [-9, 5],
    ],
    [[5, 30]],
  ],
  [[[1, 58.5]], []],
])("of 60 s, what %j does not cover is missing, but for joins of 2 s: %j", async (recorded, missing) => {
  const { missingOf } = await import("../../../../src/features/robot/plots/live-chart");
  const spans = recorded.map(([from = 0, to = 0]) => ({ from, to }));
  expect(missingOf(spans, { from: 0, to: 60 })).toEqual(missing.map(([from, to]) => ({ from, to })));
});

test.each([
  [[], "The recorder has nothing of this range."],
  [[{ startS: 0, endS: 600 }], "Values from before this page was open come from the recorder."],
  [[{ startS: 130, endS: 600 }], "2\u202fmin of this range are not recorded."],
])("a plot of ten minutes says what the recorder has: %j", async (recorded, text) => {
  say({ case: "presence", value: { key: "robomesh/test/-/alive/recorder/1", alive: true } });
  await pass();
  await draw({ fields: [WAIST], seconds: 600 });
  expect(texts(".footnote")).toEqual(["Reading the past from the recorder…"]);
  answer(await next(), SeriesAnswerSchema, { recorded });
  await pass();
  expect(texts(".footnote")).toEqual([text]);
});

test("without a recorder a plot of ten minutes warns, and one of a minute does not", async () => {
  await draw(ONE, { fields: [WAIST], seconds: 600 });
  expect(texts(".footnote.warned")).toEqual(["The past cannot be read: no recorder answers at this site"]);
});

test("plots are added up to six, changed and removed, and the others keep theirs", async () => {
  await draw();
  expect(texts(".plot-none")).toEqual(["No plot. Add one to see values over time."]);
  for (let i = 0; i < 6; i++) await press("Add plot");
  expect([stored.length, button("Add plot").disabled]).toEqual([6, true]);
  const range = find<HTMLSelectElement>('[aria-label="Time range of plot 2"]');
  expect([...range.options].map((each) => each.text)).toEqual(["10 s", "60 s", "5 min", "10 min", "30 min", "1 h"]);
  range.value = "300";
  await pressed(() => range.dispatchEvent(new Event("change", { bubbles: true })));
  await press("Fields of plot 2");
  await press("Remove plot 1");
  expect(button("Fields of plot 1").getAttribute("aria-pressed")).toBe("true");
  expect(stored.map(({ seconds }) => seconds)).toEqual([300, 60, 60, 60, 60]);
});

test("the fields to choose are those that the robot sends", async () => {
  await draw({ fields: [], seconds: 60 });
  expect(texts(".plot-word")).toEqual(["Choose the fields to plot."]);
  await press("Fields of plot 1");
  await pass();
  await send(1);
  const field = [...document.querySelectorAll("label")].find((each) => each.textContent.includes("Waist position"));
  await pressed(() => field?.querySelector("input")?.click());
  expect(stored[0]?.fields).toEqual([WAIST]);
});
