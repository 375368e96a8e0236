// A joint's range with its position, and a handle for its target.
//
// Only dragging the handle sets a target, and only releasing it sends the target; any other end of the drag resets it,
// and a tap on the track does nothing. Keys: arrows set, Enter sends, Escape resets.

import { useRef, useState } from "preact/hooks";
import { t } from "../../i18n/texts";
import { followPress } from "../hold/hold";
import type { HoldEnd } from "../hold/hold-pointer";

export interface TrackProps {
  label: string;
  lower: number;
  upper: number;
  position: number | undefined;
  /** A target that was set or sent; undefined: none. */
  target: number | undefined;
  stale: boolean;
  enabled: boolean;
  /** Steps of the arrow keys in the joint's unit: fine with Shift, coarse with Page Up and Page Down. */
  step: number;
  text: (value: number) => string;
  /** Called while the target is being set; undefined: reset. */
  preview: (value: number | undefined) => void;
  send: (value: number) => void;
}

export function JointTrack(props: TrackProps) {
  const { lower, upper, position, target, enabled } = props;
  const track = useRef<HTMLDivElement>(null);
  const [dragged, setDragged] = useState<number | undefined>(undefined);
  const [typed, setTyped] = useState<number | undefined>(undefined);
  const drag = useRef<{ pointer: number; offset: number; value?: number } | null>(null);

  const clamp = (value: number) => Math.min(upper, Math.max(lower, value));
  const share = (value: number) => `${(100 * (clamp(value) - lower)) / (upper - lower)}%`;
  const shown = dragged ?? typed ?? target ?? position;
  const unsent = dragged ?? typed;

  const valueAt = (x: number) => {
    const box = track.current?.getBoundingClientRect();
    return box ? lower + ((x - box.left) / box.width) * (upper - lower) : lower;
  };
  const take = (value: number | undefined) => {
    setDragged(undefined);
    setTyped(undefined);
    drag.current = null;
    if (value === undefined) props.preview(undefined);
    else props.send(value);
  };
  const newest = useRef(take);
  newest.current = take;
  const onDown = (event: PointerEvent & { currentTarget: HTMLElement }) => {
    if (shown === undefined) return;
    const element = event.currentTarget;
    const begun = { pointer: event.pointerId, offset: valueAt(event.clientX) - shown };
    const begin = () => {
      drag.current = begun;
      setTyped(undefined);
    };
    // A handle that was removed sends nothing.
    const end = (why: HoldEnd) =>
      newest.current(why === "released" && element.isConnected ? drag.current?.value : undefined);
    followPress(element, event, { begin, end, isDrag: true });
  };
  const onMove = (event: PointerEvent) => {
    if (drag.current?.pointer !== event.pointerId) return;
    const value = clamp(valueAt(event.clientX) - drag.current.offset);
    drag.current.value = value;
    setDragged(value);
    props.preview(value);
  };
  const onKey = (event: KeyboardEvent) => {
    if (!enabled || shown === undefined) return;
    const step = event.shiftKey ? props.step / 10 : props.step;
    const steps: Record<string, number> = {
      ArrowRight: step,
      ArrowUp: step,
      ArrowLeft: -step,
      ArrowDown: -step,
      PageUp: props.step * 10,
      PageDown: -props.step * 10,
    };
    const by = steps[event.key];
    if (by !== undefined) {
      const value = clamp(shown + by);
      setTyped(value);
      props.preview(value);
    } else if (event.key === "Enter" && typed !== undefined) take(typed);
    else if (event.key === "Escape") take(undefined);
    else return;
    event.preventDefault();
  };
  return (
    <div class={`track ${props.stale ? "stale" : ""}`} ref={track} data-moves>
      <div class="track-bar" />
      {lower < 0 && upper > 0 && <div class="track-zero" style={{ left: share(0) }} />}
      {position !== undefined && <div class="track-position" style={{ left: share(position) }} />}
      {shown !== undefined && enabled && (
        <div
          class={`track-handle ${unsent !== undefined ? "unsent" : ""}`}
          style={{ left: share(shown) }}
          role="slider"
          tabIndex={0}
          aria-label={props.label}
          title={t("joint_keys")}
          aria-valuemin={lower}
          aria-valuemax={upper}
          aria-valuenow={shown}
          aria-valuetext={props.text(shown)}
          onPointerDown={onDown}
          onPointerMove={onMove}
          onKeyDown={onKey}
          onBlur={() => typed !== undefined && take(undefined)}
        />
      )}
    </div>
  );
}
