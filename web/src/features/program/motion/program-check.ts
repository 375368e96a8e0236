// The check of the current text: requested from the mesh when typing pauses, the newest text only.

import { effect, signal } from "@preact/signals";
import type { CheckAnswer, CheckAnswer_Violation } from "../../../gen/robomesh_pb";
import { CheckAnswerSchema, CheckRequestSchema } from "../../../gen/robomesh_pb";
import { ask, inOwnName, reasonOf } from "../../../mesh/console/connection";
import { draft } from "../draft/draft";

const TYPING_ENDS_MS = 800;
const TIMEOUT_S = 30;

export interface Checked {
  text: string;
  answer: CheckAnswer;
  /** When it was requested, ms since the Unix epoch: it starts at the robot's position then. */
  at: number;
}

export const checked = signal<Checked | null>(null);
export const checking = signal(false);
/** Why there is no check; "" when there is. */
export const checkError = signal("");

let newestRequest: { robotKey: string; text: string } | null = null;

/** Check after each pause in typing, until the returned function is called. */
export function startChecking(): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let last: string | undefined;
  const end = effect(() => {
    const now = draft.value;
    if (!now || now.text === last) return;
    last = now.text;
    clearTimeout(timer);
    timer = setTimeout(checkNow, TYPING_ENDS_MS);
  });
  return () => {
    end();
    clearTimeout(timer);
    newestRequest = checked.value = null;
    checkError.value = "";
  };
}

export function checkNow(): void {
  const now = draft.value;
  if (!now?.text.trim()) {
    newestRequest = checked.value = null;
    return;
  }
  newestRequest = { robotKey: now.robotKey, text: now.text };
  if (!checking.value) void askNext();
}

async function askNext(): Promise<void> {
  checking.value = true;
  while (newestRequest) {
    const latest: { robotKey: string; text: string } = newestRequest;
    const at = Date.now();
    try {
      const key = inOwnName(`${latest.robotKey}/kinematics/check`);
      const request = { program: latest.text, path: true };
      const answer = await ask(key, CheckRequestSchema, request, CheckAnswerSchema, TIMEOUT_S);
      if (newestRequest === latest) {
        checked.value = { text: latest.text, answer, at };
        checkError.value = "";
      }
    } catch (error) {
      if (newestRequest === latest) {
        checked.value = null;
        checkError.value = reasonOf(error);
      }
    }
    if (newestRequest === latest) newestRequest = null;
  }
  checking.value = false;
}

/** Whether the displayed check is of the current text. */
export function isCurrent(): boolean {
  return checked.value !== null && checked.value.text === draft.value?.text;
}

/** The text's own errors: a program with errors is not run. */
export function errorsOf(answer: CheckAnswer | undefined): readonly CheckAnswer_Violation[] {
  return answer?.violations.filter((each) => each.kind === "program") ?? [];
}
