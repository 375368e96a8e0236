// Layout of the wall: columns of pictures of about 16:9, and the stream size for a tile.

import type { RequestedView } from "../../video/requested-view";
import { standardView } from "../../video/requested-view";

const GAP = 8;
/** Height of a tile's line of text [px]. */
const LINE = 32;
const NARROW = 600; // one column below
const SCROLLS = 880; // the page scrolls below this width, and its height does not matter
const LEAST = 220; // narrower tiles are unreadable: then the wall scrolls

/** Return the number of columns that makes equal tiles largest in an area [px]. */
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

// Few sizes and shapes, so that tiles of similar size share a stream.
const SIZES = [
  { width: 320, fps: 10 },
  { width: 480, fps: 15 },
  { width: 640, fps: 20 },
  { width: 960, fps: 25 },
] as const;
const WIDE = 16 / 9;
const SHAPES = [WIDE, 4 / 3, 1, 3 / 4] as const;
const ENOUGH = 1.2; // enlarge a picture so far before requesting the next size

/** Return the picture to request for an area [px]: of its shape, and not larger than needed. */
export function requestFor(view: string, width: number, height: number): RequestedView {
  const away = (shape: number) => Math.abs(Math.log((shape * height) / width));
  const shape = [...SHAPES].sort((a, b) => away(a) - away(b))[0] ?? WIDE;
  const size = SIZES.find((each) => width <= each.width * ENOUGH) ?? (shape === WIDE ? null : SIZES[3]);
  return size ? { of: view, ...size, height: 2 * Math.round(size.width / shape / 2) } : standardView(view);
}
