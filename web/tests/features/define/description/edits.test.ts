// Edits of a robot's description, and its file's form.

import { beforeEach, expect, test } from "vitest";
import type { Description } from "../../../../src/features/define/description/description";
import {
  complete,
  concise,
  empty,
  jointUnit,
  linkNames,
} from "../../../../src/features/define/description/description";
import {
  insertJoint,
  makeBase,
  moveJoint,
  nameFromFile,
  removeJoint,
  renameJoint,
  renameLink,
  setType,
  setUnits,
} from "../../../../src/features/define/description/edits";
import { baseName, folderOf, resolvePath } from "../../../../src/features/define/description/paths";

let robot: Description;
beforeEach(() => {
  robot = empty();
  for (const at of [0, 1, 2, 3]) insertJoint(robot, at);
});
const names = () => robot.joint.map(({ name }) => name);
function refer(): void {
  robot.frame.push({ name: "camera", link: "joint3", xyz: [0, 0, 0], rpy: [0, 0, 0] });
  robot.collision.ignore.push(["joint1", "joint3"]);
  robot.constraint.push({ joints: { joint1: 1, joint3: -1 }, limits: [0, 1] });
}
const referred = () => [robot.frame[0]?.link, robot.collision.ignore[0], robot.constraint[0]?.joints];

test("names by place follow every change, typed ones never change, and references follow both", () => {
  renameJoint(robot, 1, "joint4");
  refer();
  const steps = [names()];
  for (const change of [() => moveJoint(robot, 0, 2), () => removeJoint(robot, 3), () => insertJoint(robot, 0)]) {
    change();
    steps.push(names());
  }
  expect(steps).toEqual([
    ["joint1", "joint4", "joint3", "joint4_1"],
    ["joint4", "joint2", "joint3", "joint4_1"],
    ["joint4", "joint2", "joint3"],
    ["joint1", "joint4", "joint3", "joint4_1"],
  ]);
  // The third joint is now the second, then again the third; the first is the third, then the fourth.
  expect(referred()).toEqual(["joint3", ["joint4_1", "joint3"], { joint4_1: 1, joint3: -1 }]);
});

test("a removed joint takes with it what refers to its link, and a constraint only with its last joint", () => {
  refer();
  removeJoint(robot, 2);
  expect(referred()).toEqual([undefined, undefined, { joint1: 1 }]);
  removeJoint(robot, 0);
  expect(robot.constraint).toEqual([]);
});

test("a renamed joint renames its link and its constraints; a renamed link only the link", () => {
  refer();
  renameJoint(robot, 2, "elbow");
  expect(referred()).toEqual(["elbow", ["joint1", "elbow"], { joint1: 1, elbow: -1 }]);
  renameLink(robot, 2, "forearm");
  expect(referred()).toEqual(["forearm", ["joint1", "forearm"], { joint1: 1, elbow: -1 }]);
  expect(linkNames(robot)).toEqual(["base", "joint1", "joint2", "forearm", "joint4"]);
});

test("another type brings that type's usual limits", () => {
  setType(robot, 0, "prismatic");
  expect(robot.joint[0]).toMatchObject({ type: "prismatic", limits: [0, 500], max_speed: 250, home: 0 });
});

test("a link becomes the base, and the links before it move on by one joint", () => {
  robot.base.mesh = "meshes/Base 1.stl";
  robot.base.pose.xyz = [1, 2, 3];
  for (const [i, { link }] of robot.joint.entries()) link.mesh = `${i + 1}.stl`;
  makeBase(robot, 1);
  expect([robot.base.mesh, ...robot.joint.map(({ link }) => link.mesh)]).toEqual([
    "2.stl",
    "meshes/Base 1.stl",
    "1.stl",
    "3.stl",
    "4.stl",
  ]);
  expect([robot.base.pose.xyz, robot.joint[0]?.link.name]).toEqual([[1, 2, 3], "Base_1"]);
});

test("a robot in other units is the same robot, and back in its units it has the same numbers", () => {
  setType(robot, 1, "prismatic");
  Object.assign(robot.joint[0] ?? {}, { a: 25, alpha: -90, d: 400, theta: 45, home: 10 });
  Object.assign(robot.joint[1] ?? {}, { limits: [10, 20], home: 15 });
  robot.tool = { xyz: [1, 2, 3], rpy: [90, 0, 0] };
  robot.constraint.push({ joints: { joint2: 1 }, limits: [0, 500] }, { joints: { joint1: 1 }, limits: [0, 180] });
  robot.view = { front: { eye: [1000, 0, 0], target: [0, 0, 0], up: [0, 0, 1], projection: "perspective" } };
  refer();
  if (robot.joint[0]) robot.joint[0].link.mesh_pose.xyz = [5, 0, 0];
  const before = structuredClone(robot);
  setUnits(robot, { length: "m", angle: "rad" });
  expect(robot.joint[0]).toMatchObject({
    a: 0.025,
    alpha: expect.closeTo(-Math.PI / 2, 12),
    d: 0.4,
    limits: [-1, 1].map((sign) => expect.closeTo(sign * Math.PI, 12)),
  });
  expect(robot.joint[1]).toMatchObject({ limits: [0.01, 0.02], home: 0.015, max_speed: 0.25 });
  expect(robot.tool).toEqual({ xyz: [0.001, 0.002, 0.003], rpy: [expect.closeTo(Math.PI / 2, 12), 0, 0] });
  expect(robot.constraint.map(({ limits }) => limits[1])).toEqual(
    [0.5, Math.PI, Math.PI / 180].map((each) => expect.closeTo(each, 12)),
  );
  expect([robot.view.front?.eye, robot.joint[0]?.link.mesh_pose.xyz]).toEqual([
    [1, 0, 0],
    [0.005, 0, 0],
  ]);
  setUnits(robot, before.units);
  expect(robot).toEqual(before);
});

test("a description is the same after it was saved without its defaults and read", () => {
  refer();
  Object.assign(robot, { title: "Arm", title_zh: "机械臂", provenance: "sheet", provenance_zh: "手册" });
  Object.assign(robot.base, {
    mesh: "b.stl",
    mesh_scale: 1,
    color: "#fff",
    mesh_pose: { xyz: [1, 0, 0], rpy: [0, 0, 0] },
  });
  robot.base.pose.rpy = [0, 0, 90];
  Object.assign(robot.joint[0]?.link ?? {}, { name: "column", collision_mesh: "c.stl" });
  robot.view = { front: { eye: [1, 0, 0], target: [0, 0, 1], up: [0, 0, 1], projection: "orthographic" } };
  const read = complete(JSON.parse(JSON.stringify(concise(robot))));
  expect(read).toEqual({ ...robot, joint: robot.joint.map((joint) => ({ ...joint, numbered: false })) });
});

test.each([
  ["rotary", { length: "m", angle: "deg" }, "°"],
  ["rotary", { length: "m", angle: "rad" }, "rad"],
  ["prismatic", { length: "mm", angle: "rad" }, "mm"],
] as const)("a %s joint in %j is in %s", (type, units, unit) => {
  expect(jointUnit(type, units)).toBe(unit);
});

test.each([
  ["a/Big Arm.v2.stl", "Big_Arm.v2"],
  ["_x.stl", "x"],
  ["腰.stl", "link"],
])("the file %j names a part %j", (path, name) => {
  expect(nameFromFile(path)).toBe(name);
});

test.each([
  ["urdf/arm.urdf", "../meshes/./a.stl", "meshes/a.stl"],
  ["arm.urdf", "..\\a.stl", "a.stl"],
])("in %j the name %j is the path %j", (file, name, path) => {
  expect(resolvePath(file, name)).toBe(path);
});

test("names of files are compared without their case, in their folder", () => {
  expect([baseName("a/B.STL"), folderOf("a/b/c.stl"), folderOf("a/b/"), folderOf("a")]).toEqual([
    "b.stl",
    "a/b/",
    "a/",
    "",
  ]);
});
