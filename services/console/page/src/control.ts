// Control of one robot from this tab: the lease, commands under it, and the stop request.
//
// Only a tab that is seen renews a lease: a hidden, frozen or closed one loses control by itself,
// and the robot stops if its motion runs.

import { timestampFromMs, timestampMs } from "@bufbuild/protobuf/wkt";
import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { signal } from "@preact/signals";
import {
  CommandAnswerSchema,
  CommandRequestSchema,
  CommandRequest_Command as Command,
  LeaseAnswerSchema,
  LeaseRequestSchema,
  LeaseRequest_Action as Action,
  StopAnswerSchema,
  StopRequestSchema,
} from "./gen/robomesh_pb";
import type { LeaseAnswer } from "./gen/robomesh_pb";
import { ask } from "./mesh";
import { t } from "./texts";

/** What became of an action, in words, shown where the action was. */
export interface Notice {
  kind: "busy" | "done" | "refused";
  text: string;
}

export interface Held {
  robotKey: string;
  operator: string;
  lease: string;
  ttlMs: number;
  /** The gateway's clock minus this page's monotonic clock [ms]; never ahead of the truth. */
  clockMs: number;
  /** When it ends unless renewed, on this page's clock [ms]. */
  endsAt: number;
}

/** Values of a command beyond its name. */
export interface CommandValues {
  jointPositions?: number[];
  speedPercent?: number;
  stopId?: bigint;
}

const TTL_S = 2;
const TOLD_MS = 15_000; // how long a stop that went well is told of
const COMMAND_VALID_MS = 1000;
const OPERATOR = "robomesh.operator";
const OPERATOR_NAME = /^[A-Za-z0-9][A-Za-z0-9_.-]*$/;

export const operator = signal(localStorage.getItem(OPERATOR) ?? "");
/** The lease that this tab holds; one robot at a time. */
export const held = signal<Held | null>(null);
export const controlNotice = signal<Notice | null>(null);
export const stopNotice = signal<Notice | null>(null);

let renewing: ReturnType<typeof setTimeout> | undefined;
let lastCommand = 0n;

export function setOperator(name: string): void {
  operator.value = name;
  localStorage.setItem(OPERATOR, name);
}

export function isOperatorName(name: string): boolean {
  return OPERATOR_NAME.test(name);
}

export function holds(robotKey: string): boolean {
  return held.value?.robotKey === robotKey;
}

function reasonOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

function askLease(robotKey: string, who: string, action: Action, lease: string): Promise<LeaseAnswer> {
  const request = { action, lease, ttlS: TTL_S };
  return ask(`${robotKey}/lease/request/${who}`, LeaseRequestSchema, request, LeaseAnswerSchema, TTL_S / 2);
}

/** Asks for control of a robot in the operator's name. */
export async function take(robotKey: string): Promise<void> {
  const who = operator.value.trim();
  if (!isOperatorName(who)) {
    const text = who ? t("operator_wrong", { name: who }) : t("operator_needed");
    controlNotice.value = { kind: "refused", text };
    return;
  }
  setOperator(who);
  await release();
  controlNotice.value = { kind: "busy", text: t("taking") };
  const askedAt = performance.now();
  try {
    const answer = await askLease(robotKey, who, Action.ACQUIRE, "");
    hold(robotKey, who, answer, askedAt);
    lastCommand = 0n;
    controlNotice.value = { kind: "done", text: t("taken") };
    if (document.hidden) await release(t("released_hidden"));
  } catch (error) {
    controlNotice.value = { kind: "refused", text: t("not_taken", { text: reasonOf(error) }) };
  }
}

function hold(robotKey: string, who: string, answer: LeaseAnswer, askedAt: number): void {
  const at = (stamp: Timestamp | undefined) => (stamp ? timestampMs(stamp) : 0);
  const ttlMs = at(answer.until) - at(answer.now) || TTL_S * 1000;
  held.value = {
    robotKey,
    operator: who,
    lease: answer.lease,
    ttlMs,
    clockMs: at(answer.now) - performance.now(),
    endsAt: askedAt + ttlMs,
  };
  clearTimeout(renewing);
  renewing = setTimeout(renew, ttlMs / 3);
}

async function renew(): Promise<void> {
  const mine = held.value;
  if (!mine) return;
  const askedAt = performance.now();
  let reason = t("lease_ended");
  try {
    const answer = await askLease(mine.robotKey, mine.operator, Action.RENEW, mine.lease);
    if (held.value?.lease === mine.lease) {
      hold(mine.robotKey, mine.operator, { ...answer, lease: answer.lease || mine.lease }, askedAt);
    }
    return;
  } catch (error) {
    reason = reasonOf(error);
  }
  if (held.value?.lease !== mine.lease) return;
  if (performance.now() < mine.endsAt) renewing = setTimeout(renew, 100);
  else lose(reason);
}

function lose(reason: string): void {
  clearTimeout(renewing);
  held.value = null;
  controlNotice.value = { kind: "refused", text: t("control_lost", { text: reason }) };
}

/** Gives control back, where this tab has it. */
export async function release(text: string = t("released")): Promise<void> {
  const mine = held.value;
  if (!mine) return;
  clearTimeout(renewing);
  held.value = null;
  controlNotice.value = { kind: "done", text };
  try {
    await askLease(mine.robotKey, mine.operator, Action.RELEASE, mine.lease);
  } catch {
    // It ends by itself in at most its time to live.
  }
}

/** Tells this tab who the mesh says is in control: somebody else means that we are not. */
export function seeHolder(robotKey: string, holder: string): void {
  const mine = held.value;
  if (mine?.robotKey === robotKey && holder && holder !== mine.operator) lose(t("somebody", { name: holder }));
}

/** Sends a command under the lease; what became of it, in words. Never sends without control. */
export async function command(
  robotKey: string,
  name: Command,
  what: string,
  values: CommandValues = {},
  tell: (notice: Notice) => void = (notice) => (controlNotice.value = notice),
): Promise<boolean> {
  const mine = held.value;
  if (mine?.robotKey !== robotKey) {
    tell({ kind: "refused", text: t("not_sent", { text: t("take_first") }) });
    return false;
  }
  tell({ kind: "busy", text: t("sending", { what }) });
  const request = {
    lease: mine.lease,
    id: ++lastCommand,
    notAfter: timestampFromMs(Math.floor(performance.now() + mine.clockMs + COMMAND_VALID_MS)),
    command: name,
    ...values,
  };
  try {
    const key = `${robotKey}/command/${mine.operator}`;
    const answer = await ask(key, CommandRequestSchema, request, CommandAnswerSchema);
    if (answer.accepted) tell({ kind: "done", text: t("sent", { what }) });
    else tell({ kind: "refused", text: t("not_sent", { text: answer.text }) });
    return answer.accepted;
  } catch (error) {
    tell({ kind: "refused", text: t("not_sent", { text: reasonOf(error) }) });
    return false;
  }
}

/** Asks robots to stop, each by itself: one that does not answer delays no other. */
export async function stop(robotKeys: readonly string[]): Promise<void> {
  const name = (key: string) => key.split("/").slice(1).join("/");
  stopNotice.value = { kind: "busy", text: t("stop_sending", { robot: robotKeys.map(name).join(", ") }) };
  const by = operator.value.trim();
  const outcomes = await Promise.all(
    robotKeys.map(async (key): Promise<Notice> => {
      const robot = name(key);
      try {
        const answer = await ask(`${key}/stop`, StopRequestSchema, { reason: "console", by }, StopAnswerSchema);
        return answer.sent
          ? { kind: "done", text: t("stop_done", { robot, id: String(answer.stopId) }) }
          : { kind: "refused", text: t("stop_latched", { robot, text: answer.text }) };
      } catch (error) {
        return { kind: "refused", text: t("stop_failed", { robot, text: reasonOf(error) }) };
      }
    }),
  );
  const failed = outcomes.filter((outcome) => outcome.kind === "refused");
  const told: Notice = {
    kind: failed.length ? "refused" : "done",
    text: (failed.length ? failed : outcomes).map((outcome) => outcome.text).join(" "),
  };
  stopNotice.value = told;
  if (told.kind === "done") setTimeout(() => stopNotice.value === told && (stopNotice.value = null), TOLD_MS);
}

/** Gives control back when this tab is hidden or left. */
export function releaseWhenHidden(): void {
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) void release(t("released_hidden"));
  });
  addEventListener("pagehide", () => void release());
}

export { Command };
