// Control of one robot from this tab: request, take, offer, accept, renew, release, lose.
//
// Only a visible tab renews a lease. A hidden, frozen or closed tab therefore loses control, and the robot
// stops if it is moving. A tab that loses its connection has lost control immediately. While this thread is busy, a
// worker renews for a while (renewal.ts).
// A browser that proved slow asks for longer leases, and shows a message if it was still too slow.

import { computed, signal } from "@preact/signals";
import type { Lease, LeaseAnswer } from "../../gen/robomesh_pb";
import {
  LeaseRequest_Action as Action,
  LeaseRequest_Cause as Cause,
  LeaseAnswerSchema,
  LeaseRequestSchema,
} from "../../gen/robomesh_pb";
import { stampMs } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import type { TextName } from "../../i18n/texts";
import { t } from "../../i18n/texts";
import { AskError, ask, hello, lostAt, reasonOf } from "../console/connection";
import { isSlow, measureStalls, wasStalled } from "./page-stalls";

/** The outcome of an action, in words, shown next to the action. */
export interface Notice {
  kind: "busy" | "done" | "refused" | "lost";
  text: string;
  /** A warning of the gateway's check about an action that it carried out. */
  warning?: string;
  /** Target joints of the motion; the message disappears when they are reached. */
  target?: { what: string; positions: readonly number[]; id: bigint };
}

/** The lease that this tab holds. */
export interface HeldLease {
  robotKey: string;
  operator: string;
  lease: string;
  /** The gateway's clock minus this page's monotonic clock [ms]; a lower bound. */
  clockMs: number;
  /** When the lease ends unless renewed, on this page's clock [ms]. */
  endsAt: number;
  /** When this tab requested it, on this page's clock [ms]. */
  requestedAt: number;
  /** When it began, and when the gateway reported that, on the gateway's clock [ms]. */
  since: number;
  saidAt: number;
}

const TTL_S = 2;
const SLOW_TTL_S = 4; // a page that is blocked for 5 s has lost control
const RENEW_INTERVAL_MS = 650;
const RETRY_MS = 100;
const LATE_MS = 500;
/** Ends that another person caused, also if this page was slow at the time. */
const TAKEN = ["lease.ended.taken", "lease.ended.handed_over", "lease.ended.no_right", "lease.ended.signed_out"];
/** Refusals of a renewal after which another operator, or another window, has control. */
const HELD = ["lease.held", "lease.other"];
const OPERATOR = "robomesh.operator";
const OPERATOR_NAME = /^[A-Za-z0-9][A-Za-z0-9_.-]*$/;

/** The account's name, or without accounts the name that the operator gave. */
export const operator = signal(localStorage.getItem(OPERATOR) ?? "");
export const controlNotice = signal<Notice | null>(null);

/** Why control was released before the answer came. */
type Unwanted = { text: string; cause: Cause | undefined } | null;
type State =
  | { phase: "none" }
  | { phase: "asking"; unwanted: Unwanted }
  | { phase: "held"; lease: HeldLease; offeredTo: string }
  /** `explained`: the message gives the reason; `successor`: the lease that replaced this one. */
  | { phase: "lost"; lease: HeldLease; offeredTo: string; explained: boolean; successor: string };

/** Control by this tab, of one robot at a time.
 *
 *     phase    this tab                                             steps
 *     ------   --------------------------------------------------   -----------------------------
 *     none     has no lease                                         ask
 *     asking   waits for the answer to its request                  drop, grant; end: it was refused
 *     held     has a lease, and renews it                           renew, offer, lose; ask; end: it was released
 *     lost     shows why its lease ended without a release, until   explain; ask; end: control changed
 *              control changes again                                again
 */
class Control {
  readonly state = signal<State>({ phase: "none" });
  private renewal: ReturnType<typeof setTimeout> | undefined;

  ask(): void {
    this.become({ phase: "asking", unwanted: null });
  }

  grant(lease: HeldLease): void {
    this.become({ phase: "held", lease, offeredTo: "" });
    this.renewIn(RENEW_INTERVAL_MS);
  }

  renew(lease: HeldLease): void {
    const state = this.state.peek();
    if (state.phase !== "held") return;
    this.become({ ...state, lease });
    this.renewIn(RENEW_INTERVAL_MS);
  }

  renewIn(delayMs: number): void {
    clearTimeout(this.renewal);
    this.renewal = setTimeout(askRenewal, delayMs);
  }

  drop(unwanted: Unwanted): void {
    if (this.state.peek().phase === "asking") this.become({ phase: "asking", unwanted });
  }

  offer(offeredTo: string): void {
    const state = this.state.peek();
    if (state.phase === "held") this.become({ ...state, offeredTo });
  }

  lose(explained: boolean): void {
    const state = this.state.peek();
    if (state.phase === "held") this.become({ ...state, phase: "lost", explained, successor: "" });
  }

  /** @param successor The lease that the gateway published; the first one stays. */
  explain(successor: string): void {
    const state = this.state.peek();
    if (state.phase === "lost") this.become({ ...state, explained: true, successor: state.successor || successor });
  }

  end(): void {
    this.become({ phase: "none" });
  }

  private become(state: State): void {
    if (state.phase !== "held") clearTimeout(this.renewal);
    this.state.value = state;
  }
}

const control = new Control();
/** The lease that this tab holds. */
export const heldLease = computed(() => (control.state.value.phase === "held" ? control.state.value.lease : null));

export function setOperator(name: string): void {
  operator.value = name;
  localStorage.setItem(OPERATOR, name);
}

export function holds(robotKey: string): boolean {
  return heldLease.value?.robotKey === robotKey;
}

/** Return the operator's name if it is valid; otherwise show why it is not. */
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
  values: { lease?: string; to?: string; reason?: string; cause?: Cause } = {},
): Promise<LeaseAnswer> {
  const request = { action, ttlS: ttlS(), session: hello.value?.session ?? "", ...values };
  return ask(`${robotKey}/lease/request/${who}`, LeaseRequestSchema, request, LeaseAnswerSchema, TTL_S / 2);
}

function ttlS(): number {
  return isSlow() ? SLOW_TTL_S : TTL_S;
}

/** Take control of a robot that no operator controls. */
export const take = (robotKey: string) => begin(robotKey, Action.ACQUIRE);
/** Take control from another operator, who receives the reason; a running motion is stopped. */
export const takeOver = (robotKey: string, reason: string) => begin(robotKey, Action.TAKE, reason);
/** Accept offered control. */
export const accept = (robotKey: string) => begin(robotKey, Action.ACCEPT);

async function begin(robotKey: string, action: Action, reason = ""): Promise<void> {
  const who = ownName();
  if (!who || control.state.peek().phase === "asking") return;
  const before = heldLease.peek();
  control.ask();
  if (before) await giveBack(before);
  controlNotice.value = { kind: "busy", text: t("taking") };
  const requestedAt = performance.now();
  let unwanted: Unwanted = null;
  try {
    const answer = await askLease(robotKey, who, action, { reason });
    const state = control.state.peek();
    if (state.phase === "asking") unwanted = state.unwanted;
    control.grant(leaseFrom(robotKey, who, answer, requestedAt));
    controlNotice.value = null;
  } catch (error) {
    control.end();
    controlNotice.value = { kind: "refused", text: t("not_taken", { text: reasonOf(error) }) };
  }
  if (document.hidden) await releaseHidden();
  else if (unwanted) await release(unwanted.text, unwanted.cause);
}

/** Ask the operator in control for it; every page shows the request for half a minute. */
export async function requestControl(robotKey: string, holder: string, reason: string): Promise<void> {
  const who = ownName();
  if (who) await say(robotKey, who, Action.ASK, { reason }, t("asked", { name: holder }), "not_asked");
}

/** Offer control to another operator, or withdraw the offer. */
export async function offer(to: string | null): Promise<void> {
  const state = control.state.peek();
  if (state.phase !== "held") return;
  const mine = state.lease;
  control.offer(to ?? "");
  const values = { lease: mine.lease, to: to ?? mine.operator };
  const done = to ? t("offered", { name: to }) : t("withdrawn");
  await say(mine.robotKey, mine.operator, Action.OFFER, values, done, "not_done");
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

function leaseFrom(robotKey: string, who: string, answer: LeaseAnswer, requestedAt: number): HeldLease {
  const ttlMs = stampMs(answer.until) - stampMs(answer.now) || ttlS() * 1000;
  return {
    robotKey,
    operator: who,
    lease: answer.lease,
    clockMs: stampMs(answer.now) - performance.now(),
    endsAt: requestedAt + ttlMs,
    requestedAt,
    since: stampMs(answer.since),
    saidAt: stampMs(answer.now),
  };
}

async function askRenewal(): Promise<void> {
  const mine = heldLease.value;
  if (!mine) return;
  const requestedAt = performance.now();
  try {
    const answer = await askLease(mine.robotKey, mine.operator, Action.RENEW, { lease: mine.lease });
    if (heldLease.value?.lease !== mine.lease) return;
    const renewed = { ...answer, lease: answer.lease || mine.lease };
    control.renew(leaseFrom(mine.robotKey, mine.operator, renewed, requestedAt));
  } catch (error) {
    if (heldLease.value?.lease !== mine.lease) return;
    const silent = error instanceof AskError && error.noAnswer;
    const held = error instanceof AskError && HELD.includes(error.reason?.code ?? "");
    const slow = !held && (requestedAt > mine.endsAt + LATE_MS || wasStalled(mine.endsAt - mine.requestedAt));
    // An attempt after the end would look like a slow browser's.
    if (silent && performance.now() + RETRY_MS < mine.endsAt) control.renewIn(RETRY_MS);
    else if (slow) lose(t("lost_slow"), true);
    else if (silent) lose(t("lost_no_answer", { seconds: Math.round((mine.endsAt - mine.requestedAt) / 1000) }));
    else lose(reasonOf(error));
  }
}

/** `known`: this page knows the reason and does not need the gateway's. */
function lose(reason: string, known = false): void {
  control.lose(known);
  controlNotice.value = { kind: "lost", text: t("control_lost", { text: reason }) };
}

// Published with the release; a tab that is closed is hidden first.
const releaseHidden = () => release(t("released_hidden"), Cause.HIDDEN);

/** Release control if this tab has it; every page shows the cause. */
export async function release(text: string = t("released"), cause?: Cause): Promise<void> {
  control.drop({ text, cause });
  const state = control.state.peek();
  if (state.phase !== "held") return;
  control.end();
  await giveBack(state.lease, text, cause);
}

async function giveBack(mine: HeldLease, text = t("released"), cause?: Cause): Promise<void> {
  controlNotice.value = { kind: "done", text };
  try {
    await askLease(mine.robotKey, mine.operator, Action.RELEASE, { lease: mine.lease, ...(cause && { cause }) });
  } catch {
    // The lease expires within its time to live.
  }
}

/** Compare the published lease with this tab's: a different one means that this tab's has ended. */
export function handleLease(robotKey: string, lease: Lease): void {
  const before = control.state.peek();
  if (before.phase !== "held" && before.phase !== "lost") return;
  const mine = before.lease;
  // Messages from before this lease began do not know it.
  if (mine.robotKey !== robotKey || stampMs(lease.timestamp) <= mine.saidAt || isOf(mine, lease)) return;
  if (before.phase === "held") {
    const slow = !TAKEN.includes(lease.endedReason?.code ?? "") && wasStalled(mine.endsAt - mine.requestedAt);
    lose(slow ? t("lost_slow") : "", slow);
  }
  const state = control.state.peek();
  if (state.phase !== "lost") return;
  if (!state.explained && controlNotice.value?.kind === "lost")
    controlNotice.value = explanation(lease, state.offeredTo);
  const now = `${lease.holder} ${stampMs(lease.since)}`;
  control.explain(now);
  if (!state.successor || state.successor === now) return;
  control.end();
  if (controlNotice.value?.kind === "lost") controlNotice.value = null;
}

/** Return why this tab's lease ended, by the lease that the gateway published after it. */
function explanation(lease: Lease, offeredTo: string): Notice {
  if (offeredTo && lease.holder === offeredTo) return { kind: "done", text: t("handed_over", { name: offeredTo }) };
  const text = reasonText(lease.endedReason, lease.ended) || t("lost_unknown");
  return { kind: "lost", text: t("control_lost", { text }) };
}

function isOf(mine: HeldLease, lease: Lease): boolean {
  return lease.holder === mine.operator && stampMs(lease.since) === mine.since;
}

/** Release control when this tab is hidden; treat it as lost when the connection is.
 *
 * A closed tab sends nothing: its connection ends, its control with it, and every page is notified. */
export function followThisTab(): void {
  hello.subscribe((greeting) => {
    if (greeting?.operator) operator.value = greeting.operator;
  });
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) void releaseHidden();
  });
  lostAt.subscribe((at) => {
    if (at && heldLease.value) lose(t("lost_connection"), true);
  });
  measureStalls();
}
