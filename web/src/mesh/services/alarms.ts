// Alarms of every site, after ISA-18.2, from each site's watch, and the operator's actions on them.

import { fromBinary } from "@bufbuild/protobuf";
import { computed, signal } from "@preact/signals";
import type { Alarm, AlarmList } from "../../gen/robomesh_pb";
import {
  AlarmRequest_Action as Action,
  AlarmListSchema,
  AlarmRequestSchema,
  Alarm_Priority as Priority,
  Alarm_State as State,
} from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { ask, hello, watch } from "../console/connection";
import { operator } from "../control/control";
import { ageOf, isStale } from "../state/staleness";
import type { Latest } from "../state/topics";

export type { Alarm };
export { Action, Priority, State };

export const PRIORITIES = [Priority.CRITICAL, Priority.HIGH, Priority.MEDIUM, Priority.LOW] as const;

const lists = signal<ReadonlyMap<string, Latest<AlarmList>>>(new Map());

/** Follow the alarms while the page is open; the header counts them on every page. */
export function followAlarms(): () => void {
  return watch("robomesh/*/-/alarms", (sample) => {
    const site = sample.key.split("/")[1] ?? "";
    const message = fromBinary(AlarmListSchema, sample.payload);
    lists.value = new Map(lists.value).set(site, { key: sample.key, sample, message });
  });
}

// Unacknowledged alarms come first.
const STATES = [State.UNACKNOWLEDGED, State.RETURNED, State.ACKNOWLEDGED, State.SHELVED];

const byState = (a: Alarm, b: Alarm) => STATES.indexOf(a.state) - STATES.indexOf(b.state);
const byPriority = (a: Alarm, b: Alarm) => b.priority - a.priority;
const byTime = (a: Alarm, b: Alarm) => lastMs(b) - lastMs(a);
/** Orders of alarms; a later comparison counts where the ones before it find no difference. */
export const ALARM_ORDERS = {
  order_priority: [byPriority, byState, byTime],
  order_state: [byState, byPriority, byTime],
  order_time: [byTime],
} as const;

/** Return alarms in an order. */
export function sorted(some: readonly Alarm[], order: keyof typeof ALARM_ORDERS): Alarm[] {
  const comparisons: readonly (typeof byTime)[] = ALARM_ORDERS[order];
  return [...some].sort((a, b) => comparisons.reduce((difference, compare) => difference || compare(a, b), 0));
}

/** Every alarm, most urgent first. */
export const alarms = computed<readonly Alarm[]>(() =>
  sorted(
    [...lists.value].flatMap(([site, { message }]) =>
      message.alarms.map((alarm) => ({ ...alarm, site: alarm.site || site })),
    ),
    "order_priority",
  ),
);

/** Active alarms that are not shelved, by `robomesh/<site>/<robot>`. */
export const alarmsOf = computed(() =>
  Map.groupBy(
    alarms.value.filter(({ state }) => state === State.UNACKNOWLEDGED || state === State.ACKNOWLEDGED),
    ({ site, robot }) => `robomesh/${site}/${robot}`,
  ),
);

export const isUnacknowledged = ({ state }: Alarm): boolean =>
  state === State.UNACKNOWLEDGED || state === State.RETURNED;

export const unacknowledged = computed(() => alarms.value.filter(isUnacknowledged));

/** Number of unacknowledged alarms by priority, most urgent first. */
export const counts = computed(() =>
  PRIORITIES.map((priority) => ({
    priority,
    count: unacknowledged.value.filter((alarm) => alarm.priority === priority).length,
  })).filter(({ count }) => count > 0),
);

/** Sites that no longer report their alarms. */
export function silentSites(): string[] {
  return [...lists.value].filter(([, list]) => isStale("alarms", ageOf(list))).map(([site]) => site);
}

/** Whether any site reports its alarms. */
export const anyWatch = computed(() => lists.value.size > 0);

export function lastMs({ last, since }: Alarm): number {
  const stamp = last ?? since;
  return stampMs(stamp);
}

/** Identify an alarm among those of all sites. */
export const nameOf = ({ site, id }: Alarm): string => `${site}/${id}`;

/** The operator's name in this page's requests; empty: not given. */
export const asker = computed(() => hello.value?.operator || operator.value.trim());

/** Send a request to each site's watch for its own alarms.
 *
 * @throws AskError with the reason in words, from the first site that refused. */
export async function act(
  chosen: readonly Alarm[],
  action: Action,
  values: { reason?: string; shelveS?: number } = {},
): Promise<void> {
  const bySite = Map.groupBy(chosen, ({ site }) => site);
  const outcomes = await Promise.allSettled(
    [...bySite].map(([site, some]) => {
      const request = { action, ids: some.map(({ id }) => id), ...values };
      const key = `robomesh/${site}/-/alarms/request/${asker.value}`;
      return ask(key, AlarmRequestSchema, request, AlarmListSchema);
    }),
  );
  const failed = outcomes.find((outcome) => outcome.status === "rejected");
  if (failed) throw failed.reason;
}
