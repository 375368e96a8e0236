// Control of one robot from this tab: asked for, taken, offered, accepted, renewed, given back, lost.
//
// Only a tab that is seen renews a lease: a hidden, frozen or closed one loses control by itself,
// and the robot stops if its motion runs. A tab whose connection is gone has lost control at once.
// A browser that was seen to be slow asks for longer leases, and is told when it was too slow all the same.

import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import { signal } from "@preact/signals";
import type { Lease, LeaseAnswer } from "../gen/robomesh_pb";
import { LeaseRequest_Action as Action, LeaseAnswerSchema, LeaseRequestSchema } from "../gen/robomesh_pb";
import { reasonText } from "../i18n/reasons";
import type { TextName } from "../i18n/texts";
import { t } from "../i18n/texts";
import { AskError, ask, hello, lostAt } from "./connection";

/** What became of an action, in words, shown where the action was. */
export interface Notice {
  kind: "busy" | "done" | "refused" | "lost";
  text: string;
  /** What the gateway's check warns of in what it did all the same. */
  mind?: string;
  /** Where what was sent leads the joints: the message ends with that motion. */
  target?: { what: string; positions: readonly number[]; id: bigint };
}

/** The lease that this tab holds. */
export interface Held {
  robotKey: string;
  operator: string;
  lease: string;
  /** The gateway's clock minus this page's monotonic clock [ms]; never ahead of the truth. */
  clockMs: number;
  /** When it ends unless renewed, on this page's clock [ms]. */
  endsAt: number;
  /** When it was asked for, on this page's clock [ms]. */
  askedAt: number;
  /** When it began, and when that was said, on the gateway's clock [ms]. */
  since: number;
  saidAt: number;
}

const TTL_S = 2;
const SLOW_TTL_S = 5; // the gateway gives no more
const RENEW_EACH_MS = 650;
const SLOW_GAP_MS = 500;
const SLOW_FOR_MS = 60_000; // after such a gap
const OPERATOR = "robomesh.operator";
const OPERATOR_NAME = /^[A-Za-z0-9][A-Za-z0-9_.-]*$/;

/** Where there are accounts, the account's; otherwise what one says. */
export const operator = signal(localStorage.getItem(OPERATOR) ?? "");
/** The lease that this tab holds; one robot at a time. */
export const held = signal<Held | null>(null);
export const controlNotice = signal<Notice | null>(null);

let renewing: ReturnType<typeof setTimeout> | undefined;
let slowUntil = 0;
let beatAt = performance.now();
/** Recent gaps in which this page's timers did not run, newest last. */
let gaps: { ms: number; endedAt: number }[] = [];
let beginning = false;
let offeredTo = "";
/** A lease that ended, until the gateway has said why. */
let ended: Held | null = null;
/** The lease that was lost last, and which one is there instead. */
let lost: { mine: Held; to: string } | null = null;

export function setOperator(name: string): void {
  operator.value = name;
  localStorage.setItem(OPERATOR, name);
}

export function holds(robotKey: string): boolean {
  return held.value?.robotKey === robotKey;
}

export function reasonOf(error: unknown): string {
  if (!(error instanceof Error)) return String(error);
  // Where only the gateway's sentence is there, it says so too.
  const text = error.message.replace(/^Not (sent|run): /, "");
  return error instanceof AskError ? reasonText(error.reason, text) : text;
}

export function ms(stamp: Timestamp | undefined): number {
  return stamp ? timestampMs(stamp) : 0;
}

/** The operator's name, where it can be one; says so where it cannot. */
export function ownName(): string | null {
  const who = operator.value.trim();
  if (OPERATOR_NAME.test(who)) {
    if (!hello.value?.operator) setOperator(who);
    return who;
  }
  const text = who ? t("operator_wrong", { name: who }) : t("operator_needed");
  controlNotice.value = { kind: "refused", text };
  return null;
}

function askLease(
  robotKey: string,
  who: string,
  action: Action,
  values: { lease?: string; to?: string; reason?: string } = {},
): Promise<LeaseAnswer> {
  const request = { action, ttlS: ttlS(), session: hello.value?.session ?? "", ...values };
  return ask(`${robotKey}/lease/request/${who}`, LeaseRequestSchema, request, LeaseAnswerSchema, TTL_S / 2);
}

function ttlS(): number {
  return performance.now() < slowUntil ? SLOW_TTL_S : TTL_S;
}

/** Takes control of a robot that nobody is in control of. */
export const take = (robotKey: string) => begin(robotKey, Action.ACQUIRE);
/** Takes control away from whoever has it, who is told the reason; a motion that runs is stopped. */
export const takeOver = (robotKey: string, reason: string) => begin(robotKey, Action.TAKE, reason);
/** Accepts control that is offered. */
export const accept = (robotKey: string) => begin(robotKey, Action.ACCEPT);

async function begin(robotKey: string, action: Action, reason = ""): Promise<void> {
  const who = ownName();
  if (!who || beginning) return;
  beginning = true;
  await release();
  ended = null;
  offeredTo = "";
  controlNotice.value = { kind: "busy", text: t("taking") };
  const askedAt = performance.now();
  try {
    const answer = await askLease(robotKey, who, action, { reason });
    hold(robotKey, who, answer, askedAt);
    controlNotice.value = null;
    if (document.hidden) await putAway();
  } catch (error) {
    controlNotice.value = { kind: "refused", text: t("not_taken", { text: reasonOf(error) }) };
  }
  beginning = false;
}

/** Asks whoever is in control for it; everybody sees it for half a minute. */
export async function askFor(robotKey: string, holder: string, reason: string): Promise<void> {
  const who = ownName();
  if (who) await say(robotKey, who, Action.ASK, { reason }, t("asked", { name: holder }), "not_asked");
}

/** Offers control to another operator, or to nobody any more. */
export async function offer(to: string | null): Promise<void> {
  const mine = held.value;
  if (!mine) return;
  offeredTo = to ?? "";
  const values = { lease: mine.lease, to: to ?? mine.operator };
  const done = to ? t("offered", { name: to }) : t("withdrawn");
  await say(mine.robotKey, mine.operator, Action.OFFER, values, done, "not_offered");
}

async function say(
  robotKey: string,
  who: string,
  action: Action,
  values: { lease?: string; to?: string; reason?: string },
  done: string,
  refused: TextName,
): Promise<void> {
  try {
    await askLease(robotKey, who, action, values);
    controlNotice.value = { kind: "done", text: done };
  } catch (error) {
    controlNotice.value = { kind: "refused", text: t(refused, { text: reasonOf(error) }) };
  }
}

function hold(robotKey: string, who: string, answer: LeaseAnswer, askedAt: number): void {
  const ttlMs = ms(answer.until) - ms(answer.now) || ttlS() * 1000;
  held.value = {
    robotKey,
    operator: who,
    lease: answer.lease,
    clockMs: ms(answer.now) - performance.now(),
    endsAt: askedAt + ttlMs,
    askedAt,
    since: ms(answer.since),
    saidAt: ms(answer.now),
  };
  renewIn(RENEW_EACH_MS);
}

function renewIn(delayMs: number): void {
  clearTimeout(renewing);
  renewing = setTimeout(renew, delayMs);
}

async function renew(): Promise<void> {
  const mine = held.value;
  if (!mine) return;
  const askedAt = performance.now();
  try {
    const answer = await askLease(mine.robotKey, mine.operator, Action.RENEW, { lease: mine.lease });
    if (held.value?.lease !== mine.lease) return;
    hold(mine.robotKey, mine.operator, { ...answer, lease: answer.lease || mine.lease }, askedAt);
  } catch (error) {
    if (held.value?.lease !== mine.lease) return;
    const slow = askedAt > mine.endsAt || stoodStill(mine.endsAt - mine.askedAt);
    const silent = error instanceof AskError && error.noAnswer;
    if (silent && performance.now() < mine.endsAt) renewIn(100);
    else if (slow) lose(t("lost_slow"), true);
    else if (silent) lose(t("lost_no_answer", { seconds: Math.round((mine.endsAt - mine.askedAt) / 1000) }));
    else lose(reasonOf(error));
  }
}

/** `known`: the reason is known here, and the gateway's would be no news. */
function lose(reason: string, known = false): void {
  clearTimeout(renewing);
  ended = known ? null : held.value;
  lost = held.value && { mine: held.value, to: "" };
  held.value = null;
  controlNotice.value = { kind: "lost", text: t("control_lost", { text: reason }) };
}

// For everybody, beside the gateway's own words; a tab that is closed is hidden first.
const putAway = () => release(t("released_hidden"), "window hidden or closed");

/** Gives control back, where this tab has it; `reason` is for everybody. */
export async function release(text: string = t("released"), reason = ""): Promise<void> {
  const mine = held.value;
  if (!mine) return;
  clearTimeout(renewing);
  held.value = null;
  controlNotice.value = { kind: "done", text };
  try {
    await askLease(mine.robotKey, mine.operator, Action.RELEASE, { lease: mine.lease, reason });
  } catch {
    // It ends by itself in at most its time to live.
  }
}

/** Tells this tab what the mesh says of a robot's lease: another than ours means that ours has ended. */
export function seeLease(robotKey: string, lease: Lease): void {
  seeLoss(robotKey, lease);
  endLoss(robotKey, lease);
}

function seeLoss(robotKey: string, lease: Lease): void {
  const mine = held.value ?? ended;
  // What was said before ours began knows nothing of it.
  if (mine?.robotKey !== robotKey || ms(lease.timestamp) <= mine.saidAt) return;
  if (isOf(mine, lease)) return;
  if (held.value) {
    const slow = stoodStill(mine.endsAt - mine.askedAt);
    lose(slow ? t("lost_slow") : "", slow);
    if (slow) return;
  }
  ended = null;
  if (controlNotice.value?.kind !== "lost") return;
  controlNotice.value =
    offeredTo && lease.holder === offeredTo
      ? { kind: "done", text: t("handed_over", { name: offeredTo }) }
      : {
          kind: "lost",
          text: t("control_lost", { text: reasonText(lease.endedReason, lease.ended) || t("lost_unknown") }),
        };
}

/** A loss is told of until somebody else is in control than was right after it. */
function endLoss(robotKey: string, lease: Lease): void {
  if (lost?.mine.robotKey !== robotKey || ms(lease.timestamp) <= lost.mine.saidAt || isOf(lost.mine, lease)) return;
  const now = `${lease.holder} ${ms(lease.since)}`;
  lost.to ||= now;
  if (lost.to === now) return;
  lost = null;
  if (controlNotice.value?.kind === "lost") controlNotice.value = null;
}

function isOf(mine: Held, lease: Lease): boolean {
  return lease.holder === mine.operator && ms(lease.since) === mine.since;
}

/** Gives control back when this tab is hidden, and knows it lost when the connection is.
 *
 * One that is closed says nothing: its connection ends, and its control with it, as everybody is told. */
export function followThisTab(): void {
  hello.subscribe((greeting) => {
    if (greeting?.operator) operator.value = greeting.operator;
  });
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) void putAway();
  });
  lostAt.subscribe((at) => {
    if (at && held.value) lose(t("lost_connection"), true);
  });
  setInterval(() => {
    const now = performance.now();
    if (now - beatAt > SLOW_GAP_MS) {
      slowUntil = now + SLOW_FOR_MS;
      gaps = [...gaps.filter((each) => now - each.endedAt < SLOW_TTL_S * 1000), { ms: now - beatAt, endedAt: now }];
    }
    beatAt = now;
  }, 100);
}

/** Whether this page did nothing for most of a lease's time just now: then nobody else was late. */
function stoodStill(leaseMs: number): boolean {
  const now = performance.now();
  const recent = gaps.filter((each) => now - each.endedAt < leaseMs);
  return recent.reduce((total, each) => total + each.ms, now - beatAt) > leaseMs / 2;
}
