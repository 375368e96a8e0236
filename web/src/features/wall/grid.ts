// How many columns fill a screen with pictures of about 16:9, and which size and shape of picture a tile is worth.

import type { Wanted } from "../../video/own-view";
import { standing } from "../../video/own-view";

const GAP = 8;
/** Height of a tile's line of words [px]. */
const LINE = 32;
const NARROW = 600; // one column below
const SCROLLS = 880; // below, the page scrolls, and its height says nothing
const LEAST = 220; // a narrower tile shows nothing: then the wall scrolls

/** Columns of equal tiles, as large as they can be in a place of this size [px]. */
export function columnsFor(count: number, width: number, height: number): number {
  if (width < NARROW || count < 2) return 1;
  if (width < SCROLLS) return 2;
  const most = Math.max(1, Math.floor((width + GAP) / (LEAST + GAP)));
  let best = { columns: 1, tile: 0 };
  for (let columns = 1; columns <= Math.min(count, most); columns++) {
    const rows = Math.ceil(count / columns);
    const wide = (width - GAP * (columns - 1)) / columns;
    const high = (((height - GAP * (rows - 1)) / rows - LINE) * 16) / 9;
    const tile = Math.min(wide, high);
    if (tile > best.tile) best = { columns, tile };
  }
  return best.tile >= LEAST ? best.columns : most;
}

// Few sizes and shapes, so that tiles of about one size share one stream.
const SIZES = [
  { width: 320, fps: 10 },
  { width: 480, fps: 15 },
  { width: 640, fps: 20 },
  { width: 960, fps: 25 },
] as const;
const WIDE = 16 / 9;
const SHAPES = [WIDE, 4 / 3, 1, 3 / 4] as const;
const ENOUGH = 1.2; // so much is a picture enlarged before the next size is asked for

/** What to ask the renderer for, for a place of a size [px]: small for a small one, and of its shape, so that it is full. */
export function wantedFor(view: string, width: number, height: number): Wanted {
  const away = (shape: number) => Math.abs(Math.log((shape * height) / width));
  const shape = [...SHAPES].sort((a, b) => away(a) - away(b))[0] ?? WIDE;
  const size = SIZES.find((each) => width <= each.width * ENOUGH) ?? (shape === WIDE ? null : SIZES[3]);
  return size ? { of: view, ...size, height: 2 * Math.round(size.width / shape / 2) } : standing(view);
}
