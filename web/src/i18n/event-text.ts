// Events by code: a sentence with their values, or the alarm that ended; and the reason.
// English is the event's own text; the other catalogues have translations.

import type { Timestamp } from "@bufbuild/protobuf/wkt";
import { timestampMs } from "@bufbuild/protobuf/wkt";
import type { Event, Note } from "../gen/robomesh_pb";
import { Event_Severity as Severity } from "../gen/robomesh_pb";
import { alarmTitle } from "./alarm-text";
import { stampMs, stampWhen, whenText } from "./format";
import { reasonText } from "./reasons";
import { isSaid, operatorText } from "./stop-words";
import { isolated } from "./text-isolation";
import { compose, filled, language, message, placeholders, t } from "./texts";

// A note on an earlier time names it.
const AT_ONCE_MS = 2000;

// Alarm texts that need a value, because there may be several.
const OF_WHAT = ["joint", "second", "robot", "service", "site"] as const;

/** Return the translation of an event; null: show its own text.
 *
 * Of an event that needs action, only its reason has one. */
function translated({ code, severity, values, reason }: Event): string | null {
  if (language.value === "en") return null;
  const why = reasonText(reason, "");
  if (why && reason?.code === code) return compose("sentence", { text: why });
  if (severity > Severity.INFO) {
    const text = why && alarmTitle(code);
    return text ? compose("sentence", { text: compose("because", { text, why }) }) : null;
  }
  const sentence = message(`event.${code}`);
  if (sentence) return withValues(sentence, { ...values, cause: why && compose("event_cause", { why }) });
  const title = alarmTitle(code.replace(/\.over$/, ""));
  if (!title) return null;
  const of = OF_WHAT.map((name) => values[name]).find(Boolean);
  return of ? compose("event_over_of", { title, of }) : compose("event_over", { title });
}

/** Null: an older program sent it without a value that the sentence needs. */
function withValues(sentence: string, values: Record<string, string>): string | null {
  if (placeholders(sentence).some((name) => values[name] === undefined)) return null;
  const shown = Object.entries(values).map(([name, value]) => {
    return [name, name === "cause" ? value : (message(`event_value.${name}:${value}`) ?? isolated(value))] as const;
  });
  return filled(sentence, Object.fromEntries(shown), String);
}

/** Return the page's text of the most common events, otherwise the event's own. */
export function eventText(event: Event): string {
  const { code, values } = event;
  const by = values.by ?? "";
  const reason = values.reason;
  switch (code) {
    case "stop.latched": {
      const time = stampWhen(event.timestamp);
      const who = operatorText(by, "unnamed_operator_first");
      const text = t(values.sent === "True" ? "event_stop" : "event_stop_unsent", { by: who, time });
      return isSaid(reason) ? `${text} ${t("stop_reason", { reason })}` : text;
    }
    case "note.written": {
      if (!event.note) break;
      const { author, text } = event.note;
      const time = noteTime(event.note, event.timestamp);
      return t(time ? "event_note_on" : "event_note", { author: isolated(author), text, time });
    }
    case "stop.sent":
      return t("event_stop_sent");
    case "stop.reset":
      return t("event_stop_reset");
  }
  return translated(event) ?? event.text;
}

/** Return the time that a note is on; empty: the one at which it was written. */
function noteTime({ begin, end }: Note, written: Timestamp | undefined): string {
  const [from, at] = [begin, written].map((stamp) => stampMs(stamp)) as [number, number];
  if (!end && Math.abs(at - from) < AT_ONCE_MS) return "";
  const first = whenText(from, at);
  return end ? `${first} – ${whenText(timestampMs(end), from)}` : first;
}
