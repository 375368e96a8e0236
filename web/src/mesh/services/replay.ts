// A replay: its position, and requests to its player.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { fromBinary } from "@bufbuild/protobuf";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import { signal } from "@preact/signals";
import type { ReplayState } from "../../gen/robomesh_pb";
import { ReplayRequest_Action as Action, ReplayRequestSchema, ReplayStateSchema } from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { ask, reasonOf, watch } from "../console/connection";
import { isStale } from "../state/staleness";
import { now } from "../state/topics";

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100] as const;
const TIMEOUT_S = 5;
const FIRST_TIMEOUT_S = 0.5;
const JUMP_S = 0.5; // a larger difference from the expected position is a jump

/** Follow a replay until it is closed; times are in s from the recording's start. */
export class Replay {
  readonly state;
  /** Why the last request failed, in words. */
  readonly problem = signal("");
  private arrived = performance.now();
  private wanted: number | null = null; // a seek that is on its way
  /** When it last jumped, on the page's clock [ms]. */
  movedAt = performance.now();
  private changedAt = performance.now(); // play, pause or speed
  private firstS = 0;
  seeking = false;
  private readonly stop: () => void;

  constructor(
    readonly robotKey: string,
    first: ReplayState,
  ) {
    this.state = signal(first);
    this.stop = watch(`${robotKey}/replay`, (sample) => {
      if (sample.live) this.take(fromBinary(ReplayStateSchema, sample.payload), sample.arrived);
    });
  }

  private take(state: ReplayState, arrived: number): void {
    const [before, after] = [this.state.peek().timestamp, state.timestamp];
    // A report from before the answer does not include the request's effect.
    if (before && after && timestampMs(after) < timestampMs(before)) return;
    const was = this.state.peek();
    const jumped = Math.abs(state.positionS - this.position(arrived)) > JUMP_S * Math.max(1, state.speed);
    if (jumped) this.movedAt = arrived;
    if (jumped || state.playing !== was.playing || state.speed !== was.speed) this.changedAt = arrived;
    this.arrived = arrived;
    this.state.value = state;
  }

  /** Return the current position, extrapolated between reports. */
  position(at = performance.now()): number {
    if (this.wanted !== null) return this.wanted;
    const { positionS, playing, speed, durationS } = this.state.peek();
    return Math.min(durationS, positionS + (playing ? (Math.max(0, at - this.arrived) / 1000) * speed : 0));
  }

  /** The recorded time of the current position [ms since the Unix epoch]. */
  recordedMs(): number {
    const { start } = this.state.peek();
    return stampMs(start) + this.position() * 1000;
  }

  /** How long it has played without a jump [ms]; 0: it is not playing. */
  playedForMs(): number {
    const { playing, speed } = this.state.peek();
    return playing && speed === 1 && !this.seeking ? performance.now() - this.changedAt : 0;
  }

  /** Whether its player no longer reports. */
  get gone(): boolean {
    void now.value; // triggers drawing
    return isStale("replay", (performance.now() - this.arrived) / 1000);
  }

  readonly play = (): void => {
    const { positionS, durationS } = this.state.peek();
    if (positionS >= durationS - 1e-3) this.seek(0);
    void this.request({ action: Action.PLAY });
  };
  readonly pause = (): void => void this.request({ action: Action.PAUSE });
  readonly setSpeed = (speed: number): void => void this.request({ action: Action.SPEED, speed });
  readonly setLoop = (loop: boolean): void => void this.request({ action: Action.LOOP, loop });

  /** Report when its first joints were recorded [s]: a little after its start, where nothing is visible yet. */
  beginAt(firstS: number): void {
    this.firstS = firstS < FIRST_TIMEOUT_S ? firstS : 0;
    if (!this.state.peek().playing && this.position() < this.firstS) this.seek(this.firstS);
  }

  /** Seek to a time: at most one request is on its way, followed by the newest wish. */
  readonly seek = (to: number): void => {
    this.wanted = Math.min(this.state.peek().durationS, Math.max(this.firstS, to));
    if (!this.seeking) void this.sendSeeks();
  };

  private async sendSeeks(): Promise<void> {
    this.seeking = true;
    while (this.wanted !== null) {
      const positionS = this.wanted;
      const done = await this.request({ action: Action.SEEK, positionS });
      if (!done || this.wanted === positionS) this.wanted = null;
    }
    this.seeking = false;
    this.movedAt = this.changedAt = performance.now();
  }

  private async request(values: MessageInitShape<typeof ReplayRequestSchema>): Promise<boolean> {
    try {
      const key = `${this.robotKey}/replay/request`;
      const state = await ask(key, ReplayRequestSchema, values, ReplayStateSchema, TIMEOUT_S);
      this.take(state, performance.now());
      this.problem.value = "";
      return true;
    } catch (error) {
      this.problem.value = reasonOf(error);
      return false;
    }
  }

  /** Stop following it; it continues for other pages. */
  unfollow(): void {
    this.stop();
  }

  /** Stop the replay. */
  close(): void {
    this.stop();
    void this.request({ action: Action.CLOSE });
  }
}
