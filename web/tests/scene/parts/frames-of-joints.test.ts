// Frames computed from joint states, for a slow link.

import { create } from "@bufbuild/protobuf";
import { expect, test, vi } from "vitest";
import { JointStatesSchema } from "../../../src/gen/foxglove/JointStates_pb";
import { DescriptionSchema } from "../../../src/gen/robomesh_pb";
import { transformOf } from "../../../src/scene/parts/forward-kinematics";
import { framesOfJoints } from "../../../src/scene/parts/frames-of-joints";

const at = (x: number, y: number, z: number) => [1, 0, 0, x, 0, 1, 0, y, 0, 0, 1, z, 0, 0, 0, 1];

test("links and named frames are placed in the site, and a joint without a state is at its home", () => {
  const forward = vi.fn((_: readonly number[]) => new Map([["hand", transformOf([1, 0, 0], [0, 0, Math.PI])]]));
  const description = create(DescriptionSchema, {
    joints: [
      { name: "waist", home: 1 },
      { name: "elbow", home: 2 },
    ],
    frames: [
      { name: "tool", link: "hand", frameToLink: at(0.1, 0, 0) },
      { name: "flange", link: "hand" },
      { name: "lost", link: "none" },
    ],
    baseToSite: at(0, 0, 5),
  });
  const states = create(JointStatesSchema, { joints: [{ name: "elbow", position: 0 }] });
  const { transforms } = framesOfJoints("hall/arm", description, forward, states);
  expect(forward.mock.calls).toEqual([[[1, 0]]]);
  const placed = transforms.map(({ childFrameId, translation: p, rotation: r }) => [
    childFrameId,
    [p?.x, p?.y, p?.z].map((each) => Number(each?.toFixed(6))),
    Number(r?.z.toFixed(6)),
  ]);
  expect(placed).toEqual([
    ["hall/arm/hand", [1, 0, 5], 1],
    ["hall/arm/tool", [0.9, 0, 5], 1],
    ["hall/arm/flange", [1, 0, 5], 1],
  ]);
  description.baseToSite = [];
  expect(framesOfJoints("hall/arm", description, forward, states).transforms[0]?.translation?.z).toBe(0);
});
