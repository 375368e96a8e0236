// What the fleet knows of each robot, kept by robot: a change draws one tile, not two hundred.

import type { DescMessage, MessageShape } from "@bufbuild/protobuf";
import { fromBinary } from "@bufbuild/protobuf";
import type { Signal } from "@preact/signals";
import { batch, signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { ControllerState, Description, Lease } from "../../gen/robomesh_pb";
import { ControllerStateSchema, LeaseSchema } from "../../gen/robomesh_pb";
import type { Sample } from "../console/connection";
import { watch } from "../console/connection";
import { addKnownRobots } from "./known-robots";
import type { Latest } from "./topics";

const UPDATE_INTERVAL_MS = 250;

export interface RobotSnapshot {
  controller: Signal<Latest<ControllerState> | undefined>;
  lease: Signal<Latest<Lease> | undefined>;
  /** Its state when the tile was last visible. */
  description: Description | undefined;
}

const robots = new Map<string, RobotSnapshot>();

/** Return the snapshot of a robot; always the same object. */
export function robotSnapshot(robotKey: string): RobotSnapshot {
  const present = robots.get(robotKey);
  if (present) return present;
  const made: RobotSnapshot = { controller: signal(undefined), lease: signal(undefined), description: undefined };
  robots.set(robotKey, made);
  return made;
}

/** Follow the states and leases of every robot while the component is mounted. */
export function useFleetSnapshots(): void {
  useEffect(() => {
    const ends = [
      follow("robomesh/*/*/controller", ControllerStateSchema, (now) => now.controller),
      follow("robomesh/*/*/lease", LeaseSchema, (now) => now.lease),
    ];
    return () => {
      for (const end of ends) end();
    };
  }, []);
}

/** Decode only the newest message of each key, a few times a second. */
function follow<S extends DescMessage>(
  expression: string,
  schema: S,
  place: (now: RobotSnapshot) => Signal<Latest<MessageShape<S>> | undefined>,
): () => void {
  const waiting = new Map<string, Sample>();
  const stop = watch(expression, (sample) => waiting.set(sample.key, sample));
  const timer = setInterval(() => {
    if (waiting.size === 0) return;
    batch(() => {
      addKnownRobots(waiting.keys());
      for (const [key, sample] of waiting) {
        const robotKey = key.slice(0, key.lastIndexOf("/"));
        place(robotSnapshot(robotKey)).value = { key, sample, message: fromBinary(schema, sample.payload) };
      }
    });
    waiting.clear();
  }, UPDATE_INTERVAL_MS);
  return () => {
    clearInterval(timer);
    stop();
  };
}
