// A view of one's own: asked of the renderer, and asked for again when its pictures end.

import type { View } from "../gen/robomesh_pb";
import { ViewAnswerSchema, ViewRequestSchema } from "../gen/robomesh_pb";
import { ask, inOwnName } from "../mesh/connection";

/** What is wanted to be seen; a width of 0: as the renderer has it for everybody. */
export interface Wanted {
  /** The camera of the view of this name, or `view`. */
  of: string;
  view?: View;
  width: number;
  height: number;
  fps: number;
}

/** Keys on which the pictures come. */
export interface PictureKeys {
  video: string;
  image: string;
}

const ASK_S = 4;
const LOOK_EACH_MS = 3000;

/** The renderer's own view, for everybody. */
export function standing(of: string): Wanted {
  return { of, width: 0, height: 0, fps: 0 };
}

/** Whether it is what everybody gets. */
export function isStanding(wanted: Wanted): boolean {
  return wanted.width === 0 && wanted.fps === 0 && !wanted.view;
}

/** Has pictures of what is wanted, until the returned function is called.
 *
 * @param attach Told where they come, again when that changes; returns how to end it.
 * @param quiet Whether none has come for long: the renderer may have begun anew, and know of nothing.
 * @param refused Told why there are none, in words. */
export function withView(
  robotKey: string,
  wanted: Wanted,
  attach: (keys: PictureKeys) => () => void,
  quiet: () => boolean,
  refused: (text: string) => void,
): () => void {
  let ended = false;
  let attached = "";
  let detach: () => void = () => undefined;
  const take = (video: string, image: string) => {
    if (ended || video === attached) return;
    detach();
    attached = video;
    detach = attach({ video: `${robotKey}/${video}`, image: `${robotKey}/${image}` });
  };
  const takeStanding = () => take(`video/${wanted.of}`, `image/${wanted.of}`);
  const look = async () => {
    const { of, view, width, height, fps } = wanted;
    const request = view ? { view, width, height, fps } : { of, width, height, fps };
    try {
      const key = inOwnName(`${robotKey}/views`);
      const answer = await ask(key, ViewRequestSchema, request, ViewAnswerSchema, ASK_S);
      take(answer.topic, answer.image);
    } catch (error) {
      if (ended) return;
      refused(error instanceof Error ? error.message : String(error));
      if (!view && !attached) takeStanding(); // larger than wanted is better than none
    }
  };
  let timer: ReturnType<typeof setInterval> | undefined;
  if (isStanding(wanted)) takeStanding();
  else {
    void look();
    timer = setInterval(() => quiet() && void look(), LOOK_EACH_MS);
  }
  return () => {
    ended = true;
    clearInterval(timer);
    detach();
  };
}
