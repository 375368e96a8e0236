// The signed-in account of this page, and requests to the console about it.

import { computed, signal } from "@preact/signals";
import { accountText as a } from "../../i18n/texts";
import { hello } from "./connection";
import { RefusedRequest, readRefusal } from "./refusal";

export interface Me {
  /** Whether this console has accounts. */
  accounts: boolean;
  site: string;
  secure: boolean;
  insecure: boolean;
  /** Empty: not signed in. */
  account: string;
  role: "" | "monitor" | "operator" | "engineer" | "admin";
  operator: string;
  may_command: boolean;
  /** The right to command is suspended until the password is given again. */
  resting: boolean;
  session: string;
}

const ACTIVE_INTERVAL_MS = 60_000;
const ANSWER_TIMEOUT_MS = 10_000; // without it a page on a dead connection would wait and not reconnect

/** Null: not known yet. */
export const me = signal<Me | null>(null);
/** Why this page's last session ended, as the server's code; empty: it had none. */
export const endedBy = signal("");
export const mustSignIn = computed(() => !!me.value?.accounts && !me.value.account);
/** Whether the account's role never permits control. */
export const isMonitor = computed(() => me.value?.role === "monitor");
/** Whether the account is an administrator's. */
export const isAdministrator = computed(() => me.value?.role === "admin");
/** Whether the account may request, record, write; without accounts the mesh decides. */
export const mayAct = computed(() => !hello.value?.account || hello.value.mayCommand);
/** Whether the account may change cells; without accounts the mesh decides. */
export const isEngineer = computed(() => !me.value?.accounts || ["engineer", "admin"].includes(me.value.role));
export const commandSuspended = computed(() => !mayAct.value && !isMonitor.value);

let connects: () => void = () => undefined;

/** Ask the console which account is signed in; null: no answer. */
export async function fetchAccount(): Promise<Me | null> {
  try {
    const answer = await fetch("/account/me", { cache: "no-store", signal: AbortSignal.timeout(ANSWER_TIMEOUT_MS) });
    if (!answer.ok) return null;
    const identity = (await answer.json()) as Me;
    // A restarted console knows no sessions.
    if (me.value?.account && !identity.account) endedBy.value ||= "restart";
    me.value = identity;
    return identity;
  } catch {
    return null;
  }
}

/** Handle the end of the page's connection with its session. */
export function signedOut(word: string): void {
  endedBy.value = word || "signed_out";
  if (me.value) me.value = { ...me.value, account: "", role: "", operator: "", may_command: false, session: "" };
  void fetchAccount();
}

/** Post to `/account/...`.
 *
 * @throws RefusedRequest with the reason. */
export async function post<Answer>(path: string, body: object = {}): Promise<Answer> {
  let answer: Response;
  try {
    answer = await fetch(`/account/${path}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
  } catch {
    throw new RefusedRequest(0, a("unreachable"));
  }
  if (!answer.ok) throw await readRefusal(answer);
  return (await answer.json()) as Answer;
}

export async function signIn(name: string, password: string): Promise<void> {
  me.value = await post<Me>("sign-in", { name, password });
  endedBy.value = "";
  connects();
}

export async function unlock(password: string): Promise<void> {
  me.value = await post<Me>("unlock", { password });
}

export async function signOut(everywhere: boolean): Promise<void> {
  await post("sign-out", { everywhere });
  signedOut("signed_out");
}

/** Report activity to the console, at most once a minute: without it the right to command is suspended. */
export function reportActivity(connect: () => void): void {
  connects = connect;
  let reportedAt = 0;
  const touched = () => {
    const at = performance.now();
    if (!me.value?.account || isMonitor.value || at - reportedAt < ACTIVE_INTERVAL_MS) return;
    reportedAt = at;
    void post("active").catch(() => undefined);
  };
  for (const kind of ["pointerdown", "keydown"] as const)
    addEventListener(kind, touched, { capture: true, passive: true });
  hello.subscribe((greeting) => {
    if (greeting?.account && greeting.mayCommand !== me.value?.may_command) void fetchAccount();
  });
}
