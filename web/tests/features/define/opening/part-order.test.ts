// The order of dropped files, guessed from their names and from which parts touch.

import { expect, test } from "vitest";
import { guessOrder, stemOf } from "../../../../src/features/define/opening/part-order";

test.each([
  "base.wrl column.3ds upper_arm.wrl forearm.3ds wrist.wrl flange.3ds",
  "base.3ds column.wrl upper_arm.3ds forearm.wrl wrist.3ds wrist_cage.3ds flange.3ds",
  "link0.wrl link1.wrl link2.wrl link3.wrl link4.wrl link5.wrl link6.wrl",
  "gp8_base_link.stl gp8_link_1_s.stl gp8_link_2_l.stl gp8_link_3_u.stl gp8_link_10_t.stl",
  "base.stl shoulder.stl upperarm.stl forearm.stl wrist1.stl wrist2.stl wrist3.stl",
  "link_base.stl link_1.stl link_2.stl link_6.stl link_finger_1.stl link_finger_tip_1.stl",
  "link0.dae link1.dae link7.dae hand.dae leftfinger.dae",
  "base_link.stl shoulder_link.stl half_arm_1_link.stl half_arm_2_link.stl forearm_link.stl bracelet.stl",
  "IRB1600_Base.stp IRB1600_LowerArm.stp IRB1600_UpperArm.stp IRB1600_Wrist.stp",
  "KR6_base.stl KR6_A1.stl KR6_A2.stl KR6_A10.stl",
  "axis_01.stl axis_02.stl axis_10.stl",
  "基座.stl 关节1.stl 关节2.stl 关节10.stl",
])("names of real files give their order: %s", (names) => {
  const paths = names.split(" ").map((name) => `meshes/${name}`);
  const parts = paths.toSorted().map((path) => ({ path, points: [] }));
  expect(guessOrder(parts)).toEqual({ paths, by: "names", unnamed: [] });
});

/** Return a part from one height to another, of a width. */
const part = (path: string, from: number, to: number, wide = 0.1) => ({
  path,
  points: Array.from({ length: 21 }, (_, i) => [wide * (i % 2), 0, from + ((to - from) * i) / 20]),
});
const CHAIN = [part("c", 0, 1, 0.5), part("a", 1, 2), part("d", 2, 3), part("b", 3, 3.3)];

test("parts without names are ordered by what touches, the large lower end first", () => {
  expect(guessOrder(CHAIN.toReversed())).toEqual({
    paths: ["c", "a", "d", "b"],
    by: "geometry",
    unnamed: ["a", "b", "c", "d"],
  });
});

test("of two parts the larger and lower one is the base", () => {
  expect(guessOrder([part("a", 1, 1.5), part("b", 0, 1)])).toMatchObject({ paths: ["b", "a"], by: "geometry" });
});

test("a named base begins the order of the others", () => {
  expect(guessOrder([part("base", 3, 3.3), ...CHAIN.slice(0, 3)])).toMatchObject({
    paths: ["base", "d", "a", "c"],
    by: "both",
  });
});

test("a part without a name is put where it touches its neighbours", () => {
  const parts = [part("link1", 0, 1), part("cover", 1, 2), part("link2", 2, 3), part("link3", 3, 4)];
  expect(guessOrder(parts)).toMatchObject({ paths: ["link1", "cover", "link2", "link3"], unnamed: ["cover"] });
});

test("more parts than can be compared are taken one after the other, from the lowest", () => {
  const letters = [..."abcdefghijklmn"];
  const parts = letters.map((letter, i) => part(letter, i, i + 1));
  expect(guessOrder(parts.toReversed()).paths).toEqual(letters);
});

test("parts that are all about their own origin, or without a surface, are in the order of the alphabet", () => {
  const own = ["b", "c", "a"].map((path) => part(path, 0, 0.1));
  expect(guessOrder(own)).toMatchObject({ paths: ["a", "b", "c"], by: "alphabet" });
  expect(guessOrder([...CHAIN, { path: "e", points: [] }])).toMatchObject({ by: "alphabet" });
});

test("parts that say nothing are before the tool that has a name", () => {
  const parts = ["gripper", "x", "base"].map((path) => ({ path, points: [] }));
  expect(guessOrder(parts)).toMatchObject({ paths: ["base", "x", "gripper"], by: "names", unnamed: ["x"] });
});

test.each([
  ["a/b\\c.v2.stl", "c"],
  ["link.stl", "link"],
])("the stem of %j is %j", (path, stem) => {
  expect(stemOf(path)).toBe(stem);
});
