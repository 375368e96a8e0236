// Lines in the 3-D view.

import type { BufferGeometry, Line, LineBasicMaterial } from "three";
import { PerspectiveCamera, Vector3 } from "three";
import { expect, test } from "vitest";
import type { Nearest } from "../../../src/scene/parts/lines";
import { ClearanceLine, Path, Trail } from "../../../src/scene/parts/lines";
import type { Palette } from "../../../src/scene/parts/surroundings";

const COLOURS = { dim: "#010101", warning: "#020202", alarm: "#030303" } as Palette;
const drawnOf = ({ line: { geometry } }: Trail) =>
  [...geometry.getAttribute("position").array].filter((_, i) => i % 3 === 0).slice(0, geometry.drawRange.count);

test("the trail keeps the last 900 places while it is shown, and begins anew", () => {
  const trail = new Trail();
  trail.extend(new Vector3(1, 0, 0));
  expect(trail.line.visible).toBe(false);
  trail.show(true);
  expect(drawnOf(trail)).toEqual([]);
  for (let i = 0; i < 902; i++) trail.extend(new Vector3(i, 0, 0));
  expect(drawnOf(trail)).toEqual(Array.from({ length: 900 }, (_, i) => i + 2));
  trail.show(true);
  trail.extend(new Vector3(7, 0, 0));
  expect(drawnOf(trail)).toEqual([7]);
});

test.each([
  [null, false],
  [[[1, 2, 3]], false],
  [
    [
      [1, 2, 3],
      [4, 5, 6],
    ],
    true,
  ],
] as const)("a path of the points %o is shown: %s", (points, visible) => {
  const path = new Path();
  path.show(points);
  expect(path.line.visible).toBe(visible);
  expect([...path.line.geometry.getAttribute("position").array]).toEqual((points ?? []).flat());
});

const near = (x: number, text = `${x} mm`, level: Nearest["level"] = "normal"): Nearest => ({
  points: [
    { x, y: 0, z: 0 },
    { x, y: 2, z: 0 },
  ] as unknown as Nearest["points"],
  level,
  text,
});
function clearance() {
  const label = document.createElement("span");
  const made = new ClearanceLine(label);
  const shown = () => {
    made.placeLabel(new PerspectiveCamera(), 200, 100);
    expect(made.group.visible).toBe(!label.hidden);
    return label.hidden ? null : label.textContent;
  };
  return { made, label, shown };
}

test("the nearest points are shown with the arm's frames of the same time, and not before", () => {
  const { made, shown } = clearance();
  expect([made.waits, made.showAt(0, COLOURS), shown()]).toEqual([false, false, null]);
  made.add(near(1), 100);
  made.add(near(2), 150);
  expect([made.waits, made.showAt(74, COLOURS), shown()]).toEqual([true, false, null]);
  expect([made.showAt(75, COLOURS), shown(), made.waits]).toEqual([true, "1 mm", true]);
  expect(made.showAt(124, COLOURS)).toBe(false);
  expect([made.showAt(125, COLOURS), shown(), made.waits]).toEqual([true, "2 mm", false]);
  expect([made.hide(), shown(), made.hide(), made.showAt(999, COLOURS)]).toEqual([true, null, false, false]);
});

test.each([
  [near(1 + 0.9e-4), "1 mm"],
  [near(1 + 1.1e-4, "1 mm"), "1 mm"],
  [near(1, "other"), "other"],
  [near(1, "1 mm", "alarm"), "1 mm"],
])("points like those before need no drawing (%o)", (second, text) => {
  const { made, shown } = clearance();
  made.add(near(1, "1 mm"), 100);
  made.showAt(100, COLOURS);
  made.add({ ...second, text }, 150);
  const differs = second.level !== "normal" || text !== "1 mm" || (second.points[0]?.x ?? 0) > 1.0001;
  expect(made.waits).toBe(differs);
  expect([made.showAt(150, COLOURS), shown()]).toEqual([differs, text]);
});

test("a new publisher's earlier points replace those that wait, of which the last 20 are kept", () => {
  const { made, shown } = clearance();
  made.add(near(1), 1000);
  made.add(near(2), 10);
  made.showAt(10, COLOURS);
  expect(shown()).toBe("2 mm");
  for (let i = 0; i < 25; i++) made.add(near(10 + i), 2000 + 50 * i);
  expect([made.showAt(2000, COLOURS), made.showAt(2250, COLOURS), shown()]).toEqual([false, true, "15 mm"]);
});

test("line and label have the colour of their level, and the label is at the line's middle", () => {
  const { made, label } = clearance();
  for (const [i, level] of (["normal", "warning", "alarm"] as const).entries()) {
    made.add(near(i, "x", level), 100 * i);
    made.showAt(100 * i, COLOURS);
    made.placeLabel(new PerspectiveCamera(), 200, 100);
    const line = made.group.children[0] as Line<BufferGeometry, LineBasicMaterial>;
    expect([label.dataset.level, `#${line.material.color.getHexString()}`]).toEqual([
      level,
      { normal: COLOURS.dim, warning: COLOURS.warning, alarm: COLOURS.alarm }[level],
    ]);
  }
  const camera = new PerspectiveCamera(90, 1);
  camera.position.set(2, 1, 4);
  camera.updateMatrixWorld();
  made.placeLabel(camera, 200, 100);
  expect(label.style.translate).toBe("100px 50px");
});
