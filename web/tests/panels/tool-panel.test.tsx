// The tool's numbers, and the arm's distances to its limits.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { beforeEach, expect, test } from "vitest";
import { DescriptionSchema, KinematicStateSchema, Description_Joint_Type as Type } from "../../src/gen/robomesh_pb";
import { connect, newPage, publish } from "../console";
import { find, pass, texts } from "../hands";
import { latest } from "../latest";
import { show } from "../shown";

const ROBOT = "robomesh/hall/arm";
// Turned by 90° about z.
const POSE = [0, -1, 0, 0.1234, 1, 0, 0, -0.2, 0, 0, 1, 1.5, 0, 0, 0, 1];
const DESCRIPTION = {
  staleAfterS: 1,
  warningDistance: 0.1,
  stopDistance: 0.05,
  floor: { warningDistance: 0.02, stopDistance: 0.01 },
  joints: [
    { name: "waist", title: "Waist", type: Type.ROTARY },
    { name: "slide", type: Type.PRISMATIC },
  ],
};
let panel: typeof import("../../src/panels/tool-panel");
let draw: (
  state?: MessageInitShape<typeof KinematicStateSchema>,
  more?: { ageS?: number | null; steps?: boolean; description?: MessageInitShape<typeof DescriptionSchema> | null },
) => void;

beforeEach(async () => {
  newPage();
  panel = await import("../../src/panels/tool-panel");
  await connect();
  const place = show(null);
  draw = (state, { ageS = 0, steps = false, description = DESCRIPTION } = {}) =>
    show(
      <panel.ToolPanel
        robotKey={ROBOT}
        kinematics={state && latest(create(KinematicStateSchema, state), ageS)}
        description={description ? create(DescriptionSchema, description) : undefined}
        {...(steps && {
          steps: { choices: "frame", button: (axis, sign) => <i>{`${axis}${sign}`}</i>, notice: <em>moved</em> },
        })}
      />,
      place,
    );
});

const numbers = () => texts(".numbers .number");
/** Level, measured part, number and width [%] of a bar; null: no bar. */
function margin(name: string) {
  const row = find(`[data-margin=${name}]`);
  const bar = row.querySelector<HTMLElement>(".margin-bar > span");
  const part = (selector: string) => row.querySelector(selector)?.textContent;
  return [
    row.className.split(" ").at(-1),
    part(".margin-of"),
    part(".margin-value"),
    bar && Math.round(10 * Number.parseFloat(bar.style.width)) / 10,
  ];
}

test("the tool's place is in mm and degrees, its speed in mm/s", () => {
  draw({ toolToBase: POSE, linearVelocity: { x: 0.003, y: -0.004, z: 0.012 }, manipulability: 0.12345 });
  expect(texts(".numbers dt")).toEqual(["x", "y", "z", "roll", "pitch", "yaw", "Speed", "Manipulability"]);
  const numbers8 = ["123.4mm", "−200.0mm", "1500.0mm", "0.00°", "0.00°", "90.00°", "13.0mm/s", "0.1235"];
  expect(numbers()).toEqual(numbers8);
});

test("what is not known is a dash, not a zero", () => {
  draw();
  expect(texts(".panel-end")).toEqual(["no data yet"]);
  expect(numbers()).toEqual(["–mm", "–mm", "–mm", "–°", "–°", "–°", "–mm/s", "–"]);
  expect(texts(".margin-value")).toEqual(["–", "–", "–", "–"]);
  draw({ toolToBase: POSE.slice(1) });
  expect(numbers()[0]).toBe("–mm");
});

test.each([
  [0.9, false, ""],
  [1.1, true, "stale 1\u202fs"],
  [null, true, "stale, age unknown"],
])("numbers of an age of %s s are shown as stale: %s", async (ageS, stale, says) => {
  draw({ toolToBase: POSE }, { ageS });
  expect(texts(".panel-end")).toEqual([says]);
  expect(find(".numbers").classList.contains("outdated")).toBe(stale);
  expect(find(".margins").classList.contains("stale")).toBe(stale);
});

test("who is in control has buttons at each axis, and their message", () => {
  draw({ toolToBase: POSE }, { steps: true });
  const signs = panel.POSE_AXES.flatMap((axis) => [`${axis}-1`, `${axis}1`]);
  expect([texts(".numbers i"), texts("em"), texts(".panel-end")]).toEqual([signs, ["moved"], ["frame"]]);
  draw({ toolToBase: POSE });
  expect(texts(".numbers i, em")).toEqual([]);
});

const clearance = (distance: number, second = "hall/table") => ({ distance, first: "hall/arm/flange", second });

test.each([
  [clearance(0.15), ["normal", "flange – table", "150.0\u202fmm", 50]],
  [clearance(0.0999), ["warning", "flange – table", "99.9\u202fmm", 33.3]],
  [clearance(0.0499), ["alarm", "flange – table", "49.9\u202fmm", 16.6]],
  [clearance(0), ["alarm", "flange – table", "they touch", 0]],
  [clearance(0.03, "hall/the floor"), ["normal", "flange – the floor", "30.0\u202fmm", 10]],
  [clearance(0.0199, "hall/the floor"), ["warning", "flange – the floor", "19.9\u202fmm", 6.6]],
  [clearance(9), ["normal", "flange – table", "9000.0\u202fmm", 100]],
])("a distance to the surroundings is judged by the robot's limits (%o)", async (distance, row) => {
  draw({ clearance: distance });
  publish(`${ROBOT}/description`, DescriptionSchema, DESCRIPTION);
  await pass(100);
  expect(margin("clearance")).toEqual(row);
});

test("the bar of a robot with a long warning distance is full there", () => {
  draw({ clearance: clearance(0.3) }, { description: { ...DESCRIPTION, warningDistance: 0.6 } });
  expect(margin("clearance")[3]).toBe(50);
  draw({ clearance: clearance(0.15) }, { description: null });
  expect(margin("clearance")[3]).toBe(50);
});

test("of the arm's own links only contact is an alarm", () => {
  draw({ ownClearance: { distance: 0.003, first: "hall/arm/wrist", second: "hall/arm/base" } });
  expect(margin("own-clearance").slice(0, 3)).toEqual(["normal", "wrist – base", "3.0\u202fmm"]);
  draw({ ownClearance: { distance: 0, first: "hall/arm/wrist", second: "hall/arm/base" } });
  expect(margin("own-clearance").slice(0, 3)).toEqual(["alarm", "wrist – base", "they touch"]);
  expect(find("[data-margin=own-clearance] [role=img]").getAttribute("aria-label")).toBe("error");
});

test("a distance that is not computed says why", () => {
  draw({});
  expect([margin("clearance")[2], margin("own-clearance")[2]]).toEqual(["nothing around", "–"]);
  draw({ jointsUnproven: true, notCounted: ["arm2", "arm3"] });
  expect([margin("clearance")[2], margin("own-clearance")[2]]).toEqual(["unproven", "unproven"]);
  expect(texts(".not-counted")).toEqual([expect.stringContaining("arm2, arm3")]);
});

const of = (name: string, lower: number, upper: number) => ({ name, lower, upper });

test.each([
  [
    [of("waist", 1, 1), of("slide", 0.1, 0.3)],
    ["normal", "slide", "100.0mm", 50],
  ],
  [
    [of("slide", 0.2, 0.2), of("waist", Math.PI / 2, Math.PI / 6)],
    ["normal", "Waist", "30.00°", 50],
  ],
  [[of("waist", 0.0199, 0.9801)], ["warning", "Waist", "1.14°", 4]],
  [[of("waist", 0.02, 0.98)], ["normal", "Waist", "1.15°", 4]],
  [[of("waist", -0.01, 1.01)], ["alarm", "Waist", "−0.57°", 0]],
  [[of("waist + slide", 0.001, 0.999)], ["warning", "waist + slide", "0.06°", 0.2]],
])("the joint that is nearest to a limit by its share of the range is shown (%o)", (limitMargins, row) => {
  draw({ limitMargins });
  expect(margin("limit")).toEqual(row);
  const shape = find("[data-margin=limit]").querySelector("[role=img]")?.getAttribute("aria-label");
  expect(shape).toBe({ normal: undefined, warning: "warning", alarm: "error" }[row[0] ?? ""]);
});

test.each([
  [0.125, ["normal", undefined, "0.125", 50]],
  [0.0199, ["warning", undefined, "0.020", 8]],
  [0, ["warning", undefined, "0.000", 0]],
])("a distance to a singularity of %s", (singularityMargin, row) => {
  draw({ singularityMargin });
  expect(margin("singularity")).toEqual(row);
});
