// A step of the tool, and where it leads.

import { create } from "@bufbuild/protobuf";
import { Euler, Matrix4, Vector3 } from "three";
import { expect, test } from "vitest";
import { endText, FRAMES, poseAfter } from "../../../../src/features/robot/motion/tool-step";
import { DescriptionSchema } from "../../../../src/gen/robomesh_pb";
import { POSE_AXES } from "../../../../src/panels/tool-panel";

const rad = (degrees: number) => (degrees * Math.PI) / 180;
const placed = (roll: number, pitch: number, yaw: number) =>
  new Matrix4().makeRotationFromEuler(new Euler(rad(roll), rad(pitch), rad(yaw), "ZYX"));
const rows = (matrix: Matrix4) => matrix.clone().transpose().elements as number[];
const POSE = placed(20, -50, 110).setPosition(0.3, -0.2, 0.5);
const BASE_TO_SITE = placed(5, 15, 90);
const FRAME_TO_BASE = { tool: POSE, base: new Matrix4(), site: BASE_TO_SITE.clone().transpose() };

test.each(FRAMES.flatMap((frame) => POSE_AXES.map((axis) => [axis, frame] as const)))(
  "a step along or about %s of the frame %s ends where three.js says",
  (axis, frame) => {
    const number = POSE_AXES.indexOf(axis);
    const along = new Vector3().setFromMatrixColumn(FRAME_TO_BASE[frame], number % 3);
    const at = new Vector3().setFromMatrixPosition(POSE);
    const end =
      number < 3
        ? POSE.clone().setPosition(at.addScaledVector(along, 0.02))
        : new Matrix4().makeRotationAxis(along, rad(20)).multiply(POSE).setPosition(at);
    const found = poseAfter(rows(POSE), { axis, frame, amount: 20 }, rows(BASE_TO_SITE));
    for (const [i, element] of rows(end).entries()) expect(found[i]).toBeCloseTo(element, 12);
  },
);

test("the end of steps is told as position, or after a turn as angles; of an unknown pose not at all", () => {
  const description = create(DescriptionSchema, { baseToSite: rows(placed(0, 0, 90)) });
  const pose = rows(new Matrix4().setPosition(0.1, 0, 1));
  const up = { axis: "z", frame: "tool", amount: 5 } as const;
  const aside = { axis: "x", frame: "site", amount: 10 } as const;
  expect(endText(pose, [up, aside], description)).toBe("x 100.0, y −10.0, z 1005.0\u202fmm");
  expect(endText(pose, [aside], undefined)).toBe("x 110.0, y 0.0, z 1000.0\u202fmm");
  expect(endText(pose, [up, { axis: "yaw", frame: "base", amount: -30 }], description)).toBe(
    "roll 0.00°, pitch 0.00°, yaw −30.00°",
  );
  expect([endText(undefined, [up], description), endText(pose, [], description)]).toEqual(["–", "–"]);
});
