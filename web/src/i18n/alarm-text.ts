// Alarms by code: what happened and what to do; and the cause. English is the watch's own text; the other catalogues
// have translations.

import type { Alarm } from "../gen/robomesh_pb";
import { reasonText } from "./reasons";
import { compose, message } from "./texts";

/** Return the translation of an alarm with a known code; null: show the watch's text. */
export function alarmTitle(code: string): string | null {
  return message(`alarm.${code}`) ?? null;
}

/** Return the translation of an alarm with its cause; null: show the watch's text. */
export function alarmText({ code, cause }: Alarm): string | null {
  const [title, why] = [alarmTitle(code), reasonText(cause, "")];
  return title && why ? compose("because", { text: title, why }) : title;
}

export function alarmAdvice(code: string, told: string): string {
  return message(`advice.${code}`) ?? told;
}
