// The wall: how many columns its pictures have, and which pictures are requested.

import { expect, test } from "vitest";
import { columnsFor, requestFor } from "../../../src/features/wall/grid";

test.each([
  [1, 1920, 1080, 1],
  [4, 1920, 1080, 2],
  [9, 1920, 1080, 3],
  [6, 3000, 600, 6],
  [6, 900, 2000, 1],
  [5, 599, 1080, 1],
  [5, 700, 400, 2],
  [400, 1000, 700, 4],
])("%i pictures on %i x %i px are in %i columns", (count, width, height, columns) => {
  expect(columnsFor(count, width, height)).toBe(columns);
});

test("no other number of columns makes the pictures larger", () => {
  for (let count = 2; count <= 20; count++) {
    const tile = (columns: number) => {
      const rows = Math.ceil(count / columns);
      return Math.min((1920 - 8 * (columns - 1)) / columns, (((1080 - 8 * (rows - 1)) / rows - 32) * 16) / 9);
    };
    const best = Math.max(...Array.from({ length: count }, (_, i) => tile(i + 1)));
    expect(tile(columnsFor(count, 1920, 1080))).toBe(best);
  }
});

test.each([
  [320, 180, { width: 320, height: 180, fps: 10 }],
  [384, 216, { width: 320, height: 180, fps: 10 }],
  [385, 217, { width: 480, height: 270, fps: 15 }],
  [400, 400, { width: 480, height: 480, fps: 15 }],
  [600, 450, { width: 640, height: 480, fps: 20 }],
  [2000, 2000, { width: 960, height: 960, fps: 25 }],
])("an area of %i x %i px gets the picture %j", (width, height, picture) => {
  expect(requestFor("top", width, height)).toEqual({ of: "top", ...picture });
});

test("a large area of the usual shape gets the stream that all others get", async () => {
  const { standardView } = await import("../../../src/video/requested-view");
  expect(requestFor("top", 1920, 1080)).toEqual(standardView("top"));
});
