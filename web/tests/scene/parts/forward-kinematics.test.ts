// Placements of links from a URDF, or from D-H rows. tests/browser/test_forward.py compares whole robots with their models.

import { Matrix4, Vector3 } from "three";
import { expect, test } from "vitest";
import { alongAxis, forwardOf, linkPlacements, transformOf } from "../../../src/scene/parts/forward-kinematics";

const joint = (name: string, type: string, parent: string, child: string, more = "") =>
  `<joint name="${name}" type="${type}"><parent link="${parent}"/><child link="${child}"/>${more}</joint>`;
// In no order: a branch, a fixed joint, an axis that is not of length 1, and joints without origin or axis.
const URDF = `<robot>
${joint("finger", "prismatic", "hand", "finger", '<axis xyz="0 2 0"/><mimic joint="turn" multiplier="-2" offset="0.5"/>')}
${joint("twin", "prismatic", "hand", "twin", '<mimic joint="turn"/>')}
${joint("mount", "fixed", "hand", "camera", '<origin xyz="0 0 0.1"/>')}
${joint("turn", "revolute", "base", "hand", '<origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 1"/>')}
<link name="base"/></robot>`;

function points(positions: readonly number[], forward = forwardOf(URDF, ["unused", "turn"])) {
  const at = (matrix: Matrix4) =>
    new Vector3(1, 0, 0)
      .applyMatrix4(matrix)
      .toArray()
      .map((each) => Number(each.toFixed(6)) + 0);
  return Object.fromEntries([...forward(positions)].map(([link, placement]) => [link, at(placement)]));
}

test("each link is placed after its parent, by its joint's origin, axis and position", () => {
  // At 0 the hand is turned by its origin, at π/2 once more.
  expect(points([9, 0])).toEqual({
    base: [1, 0, 0],
    hand: [1, 3, 3],
    camera: [1, 3, 3.1],
    finger: [0.5, 3, 3],
    twin: [1, 3, 3],
  });
  const turned = points([9, Math.PI / 2]);
  expect(turned.hand).toEqual([0, 2, 3]);
  expect(turned.camera).toEqual([0, 2, 3.1]);
  expect(turned.finger).toEqual([0, Number((2 - (0.5 - Math.PI)).toFixed(6)), 3]);
  expect(turned.twin).toEqual([Number((-Math.PI / 2).toFixed(6)), 2, 3]);
});

test("a joint without a position is at 0, and an invalid URDF has no links", () => {
  expect(points([])).toEqual(points([9, 0]));
  expect(points([], forwardOf("<robot><joint/></rob", []))).not.toHaveProperty("base");
  expect(points([], forwardOf("", []))).toEqual({});
});

test("a D-H row is Rot(z, theta) Trans(a, 0, d) Rot(x, alpha)", () => {
  const row = { theta: 0.3, d: 2, a: 5, alpha: -1.2 };
  const [ct, st, ca, sa] = [Math.cos(0.3), Math.sin(0.3), Math.cos(-1.2), Math.sin(-1.2)];
  const expected = new Matrix4(
    ...[ct, -st * ca, st * sa, 5 * ct],
    ...[st, ct * ca, -ct * sa, 5 * st],
    ...([0, sa, ca, 2, 0, 0, 0, 1] as [number, number, number, number, number, number, number, number]),
  );
  const start = transformOf([0, 0, 7], [0, 0, 0]);
  const [base, first, second] = linkPlacements(start, [row, row]);
  expect(base?.elements).toEqual(new Matrix4().elements);
  const chain = [start.clone().multiply(expected), start.clone().multiply(expected).multiply(expected)];
  const numbers = (placements: (Matrix4 | undefined)[]) =>
    placements.map((each) => each?.elements.map((element) => Number(element.toFixed(12))));
  expect(numbers([first, second])).toEqual(numbers(chain));
  expect(alongAxis(row).elements[14]).toBe(2);
});
