// Format of numbers, times, ages and placements.

import { create } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { afterEach, expect, test } from "vitest";
import { DescriptionSchema, Description_Joint_Type as Type } from "../../src/gen/robomesh_pb";
import * as page from "../../src/i18n/format";
import { showFirstLanguage } from "../../src/i18n/texts";
import { commonOf, labelOf, shownUnit } from "../../src/i18n/units";

const SUMMER = 1_785_340_931_000;
const WINTER = 1_795_932_131_000;
const zone = process.env.TZ;

afterEach(() => {
  process.env.TZ = zone;
  if (!zone) delete process.env.TZ;
  return showFirstLanguage("en");
});

test.each([
  [-1.005, 1, "−1.0"],
  [-0.004, 2, "0.00"],
  [0.005, 1, "0.0"],
  [12, 0, "12"],
  [undefined, 1, "–"],
  [Number.NaN, 1, "–"],
  [Number.POSITIVE_INFINITY, 1, "–"],
])("%s with %i decimals is %s: with a true minus, and none before 0", (value, decimals, text) => {
  expect(page.fixed(value, decimals)).toBe(text);
});

test.each([
  [Type.ROTARY, Math.PI / 2, "90.00°"],
  [Type.TYPE_UNSPECIFIED, -Math.PI, "−180.00°"],
  [Type.PRISMATIC, 0.12345, "123.5\u202fmm"],
  [77 as Type, 1.5, "1.5000\u202f"],
  [Type.ROTARY, undefined, "–°"],
])("a joint of the type %i at %s is %s", (type, value, text) => {
  expect(page.jointText({ type } as never, value)).toBe(text);
  expect(page.toRadians(page.toDegrees(value ?? 0))).toBeCloseTo(value ?? 0);
});

test("titles are in the page's language, if they have one", async () => {
  const joints = [{ name: "j1", title: "Waist", titleZh: "腰" }, { name: "j1", title: "Waist" }, { name: "j1" }];
  const robot = create(DescriptionSchema, {
    title: "Arm",
    titleZh: "机械臂",
    provenance: "Chen",
    provenanceZh: "陈",
    joints,
  });
  const shown = () => [...robot.joints.map(page.jointTitle), page.robotTitle(robot), page.provenanceText(robot)];
  expect(shown()).toEqual(["Waist", "Waist", "j1", "Arm", "Chen"]);
  await showFirstLanguage("zh");
  expect(shown()).toEqual(["腰", "Waist", "j1", "机械臂", "陈"]);
  const english = create(DescriptionSchema, { title: "Arm", provenance: "Chen" });
  expect([page.robotTitle(english), page.provenanceText(english)]).toEqual(["Arm", "Chen"]);
});

test.each([
  [0.9, "0\u202fs"],
  [99.9, "99\u202fs"],
  [100, "1\u202fmin"],
  [5999, "99\u202fmin"],
  [6000, "1\u202fh"],
])("%f s are %s", (seconds, text) => {
  expect(page.ageText(seconds)).toBe(text);
  expect(page.staleText(seconds)).toContain(text);
});

test("an age that is not known is said so, not shown as 0", () => {
  expect(page.staleText(null)).toBe("stale, age unknown");
});

test("counts have separators, durations are like a clock's", () => {
  expect([page.count(4312), page.count(2n ** 40n)]).toEqual(["4,312", "1,099,511,627,776"]);
  expect([12.9, 3663].map(page.clock)).toEqual(["00:12", "61:03"]);
});

test.each([
  ["Asia/Shanghai", "2026-07-30 00:02:11+08:00", "2026-11-29 14:02:11+08:00"],
  ["America/St_Johns", "2026-07-29 13:32:11-02:30", "2026-11-29 02:32:11-03:30"],
  ["UTC", "2026-07-29 16:02:11+00:00", "2026-11-29 06:02:11+00:00"],
])("in %s a time has its date and the zone of that date", (name, summer, winter) => {
  process.env.TZ = name;
  expect([SUMMER, WINTER].map((ms) => page.timeText(ms))).toEqual([summer, winter]);
  expect([page.whenText(SUMMER, SUMMER), page.whenText(SUMMER, WINTER)]).toEqual([summer.slice(11), summer]);
  const stamp = timestampFromMs(SUMMER);
  expect([page.stampTime(stamp), page.stampFull(stamp), page.stampWhen(stamp)]).toEqual([
    summer.slice(11, 19),
    summer,
    summer,
  ]);
});

test("a time that is not known is a dash, and what was seen has milliseconds", () => {
  process.env.TZ = "Asia/Shanghai";
  expect([page.timeText(0), page.timeText(1e300), page.whenText(0)]).toEqual(["–", "–", "–"]);
  expect([page.stampTime, page.stampWhen, page.stampFull, page.stampMs].map((of) => of(undefined))).toEqual([
    "–",
    "–",
    "",
    0,
  ]);
  expect(page.timeText(WINTER + 7, true)).toBe("2026-11-29 14:02:11.007+08:00");
});

/** Return the rows of a placement that turns by angles about fixed x, y, z. */
function turned(roll: number, pitch: number, yaw: number): number[] {
  const [cr, sr, cp, sp, cy, sy] = [roll, pitch, yaw].flatMap((each) => [Math.cos(each), Math.sin(each)]) as [
    number,
    number,
    number,
    number,
    number,
    number,
  ];
  return [
    cy * cp,
    cy * sp * sr - sy * cr,
    cy * sp * cr + sy * sr,
    0,
    sy * cp,
    sy * sp * sr + cy * cr,
    sy * sp * cr - cy * sr,
    0,
    -sp,
    cp * sr,
    cp * cr,
    0,
    0,
    0,
    0,
    1,
  ];
}
test.each([
  [0.1, -0.2, 3],
  [-3, 1.5, -0.4],
  [0, 0, 0],
])("roll %f, pitch %f, yaw %f are read from a placement", (...angles) => {
  for (const [i, angle] of page.rollPitchYaw(turned(...angles)).entries()) expect(angle).toBeCloseTo(angles[i] ?? 0);
});

test("of an upright tool only the sum of roll and yaw is known: yaw is 0", () => {
  const [roll, pitch, yaw] = page.rollPitchYaw(turned(0.5, Math.PI / 2, 0.2));
  expect([roll, pitch, yaw]).toEqual([expect.closeTo(0.3), expect.closeTo(Math.PI / 2), 0]);
  expect(page.rollPitchYaw([])).toEqual([0, -0, 0]);
});

test.each([
  ["rad", "°", 180 / Math.PI],
  ["m/s", "mm/s", 1000],
  ["N·m", "N·m", 1],
  ["furlong", "furlong", 1],
])("numbers in %s are shown in %s", (unit, shown, factor) => {
  expect(shownUnit(unit)).toMatchObject({ unit: shown, factor });
});

test.each([
  [["joints/waist/position", "joints/elbow/position"], "position", ["waist", "elbow"]],
  [["joints/waist/position", "joints/waist/effort"], "", ["waist position", "waist effort"]],
  [["joints/waist/position"], "", ["waist position"]],
  [["a/position", "joints/waist/position"], "", ["position", "waist position"]],
  [["joints"], "", ["joints"]],
])("of %j the common part is %j", (values, common, labels) => {
  expect(commonOf(values)).toBe(common);
  expect(values.map((value) => labelOf(value, common))).toEqual(labels);
});
