// Who is signed in on this page, and the console's word on it.

import { computed, signal } from "@preact/signals";
import { hello } from "./connection";

export interface Me {
  /** Whether this console has accounts at all. */
  accounts: boolean;
  site: string;
  secure: boolean;
  insecure: boolean;
  /** Empty: nobody is signed in. */
  account: string;
  role: "" | "monitor" | "operator" | "admin";
  operator: string;
  may_command: boolean;
  /** The right to command rests until the password is given again. */
  resting: boolean;
  session: string;
}

/** A request that was refused; `word` is the server's, for the page. */
export class AccountError extends Error {
  constructor(
    readonly word: string,
    text: string,
    readonly seconds = 0,
  ) {
    super(text);
  }
}

const ACTIVE_EACH_MS = 60_000;
const ANSWERED_WITHIN_MS = 10_000; // else a page on a dead line would wait for it, and try no other

/** Null: not known yet. */
export const me = signal<Me | null>(null);
/** Why the last session of this page ended, in the server's word; empty: there was none. */
export const endedBy = signal("");
export const mustSignIn = computed(() => !!me.value?.accounts && !me.value.account);
/** Whether this account may ask for control, were it not for what rests. */
export const onlyWatches = computed(() => me.value?.role === "monitor");
export const rests = computed(() => !!hello.value?.account && !hello.value.mayCommand && !onlyWatches.value);

let connects: () => void = () => undefined;

/** Asks the console who one is; null: it does not answer. */
export async function whoAmI(): Promise<Me | null> {
  try {
    const answer = await fetch("/account/me", { cache: "no-store", signal: AbortSignal.timeout(ANSWERED_WITHIN_MS) });
    if (!answer.ok) return null;
    const told = (await answer.json()) as Me;
    // A console that was started anew knows no sessions.
    if (me.value?.account && !told.account) endedBy.value ||= "restart";
    me.value = told;
    return told;
  } catch {
    return null;
  }
}

/** The page's connection was ended with its session. */
export function signedOut(word: string): void {
  endedBy.value = word || "signed_out";
  if (me.value) me.value = { ...me.value, account: "", role: "", operator: "", may_command: false, session: "" };
  void whoAmI();
}

/** Posts to `/account/...`.
 *
 * @throws AccountError with the server's word and text. */
export async function post<Answer>(path: string, body: object = {}): Promise<Answer> {
  let answer: Response;
  try {
    answer = await fetch(`/account/${path}`, {
      method: "POST",
      headers: { "Content-Type": "application/json" },
      body: JSON.stringify(body),
    });
  } catch {
    throw new AccountError("unreachable", "");
  }
  const told = (await answer.json().catch(() => ({}))) as { error?: string; text?: string; seconds?: number };
  if (!answer.ok) throw new AccountError(told.error ?? "unreachable", told.text ?? "", told.seconds ?? 0);
  return told as Answer;
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

/** Tells the console that a person is here, once a minute at most: otherwise the right to command rests. */
export function followPerson(connect: () => void): void {
  connects = connect;
  let told = 0;
  const touched = () => {
    const at = performance.now();
    if (!me.value?.account || onlyWatches.value || at - told < ACTIVE_EACH_MS) return;
    told = at;
    void post("active").catch(() => undefined);
  };
  for (const kind of ["pointerdown", "keydown"] as const)
    addEventListener(kind, touched, { capture: true, passive: true });
  hello.subscribe((greeting) => {
    if (greeting?.account && greeting.mayCommand !== me.value?.may_command) void whoAmI();
  });
}
