// A view requested from the renderer for this page, and requested again when its pictures stop.

import type { View } from "../gen/robomesh_pb";
import { ViewAnswerSchema, ViewRequestSchema } from "../gen/robomesh_pb";
import { ask, inOwnName, reasonOf } from "../mesh/console/connection";

/** The wanted picture; a width of 0: the renderer's standard size. */
export interface RequestedView {
  /** The camera of the view of this name, or `view`. */
  of: string;
  view?: View;
  width: number;
  height: number;
  fps: number;
}

/** Keys of the pictures. */
export interface PictureKeys {
  video: string;
  image: string;
}

const TIMEOUT_S = 4;
const CHECK_INTERVAL_MS = 3000;

/** Keys of the renderer's standard view. */
export function standardView(of: string): RequestedView {
  return { of, width: 0, height: 0, fps: 0 };
}

/** Return whether it is the standard view. */
export function isStandardView(wanted: RequestedView): boolean {
  return wanted.width === 0 && wanted.fps === 0 && !wanted.view;
}

/** Receive pictures of a view until the returned function is called.
 *
 * @param attach Called with the keys, again when they change; returns a function that detaches.
 * @param quiet Returns whether no picture has arrived for long: the renderer may have restarted.
 * @param refused Called with the reason why there are none. */
export function receiveView(
  robotKey: string,
  wanted: RequestedView,
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
  const takeStandardView = () => take(`video/${wanted.of}`, `image/${wanted.of}`);
  const requestView = async () => {
    const { of, view, width, height, fps } = wanted;
    const request = view ? { view, width, height, fps } : { of, width, height, fps };
    try {
      const key = inOwnName(`${robotKey}/views`);
      const answer = await ask(key, ViewRequestSchema, request, ViewAnswerSchema, TIMEOUT_S);
      take(answer.topic, answer.image);
    } catch (error) {
      if (ended) return;
      refused(reasonOf(error));
      if (!view && !attached) takeStandardView(); // a larger picture than wanted is better than none
    }
  };
  let timer: ReturnType<typeof setInterval> | undefined;
  if (isStandardView(wanted)) takeStandardView();
  else {
    void requestView();
    timer = setInterval(() => quiet() && void requestView(), CHECK_INTERVAL_MS);
  }
  return () => {
    ended = true;
    clearInterval(timer);
    detach();
  };
}
