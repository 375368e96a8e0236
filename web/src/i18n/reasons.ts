// Why a request is refused, control ended or a motion is not checked: reasons of the mesh in the page's language.
// A reason brings its English sentence; the other catalogues have translations by code.

import OF_KINDS from "../gen/reasons-of-kinds.json";
import type { Reason } from "../gen/robomesh_pb";
import { isSaid } from "./stop-words";
import { isolated } from "./text-isolation";
import { filled, language, message, placeholders, t } from "./texts";

/** Translations of reasons that only one kind of controllers has, by language and the catalogue's key. */
const SENTENCES_OF_KINDS: Readonly<Partial<Record<string, Readonly<Partial<Record<string, string>>>>>> = OF_KINDS;
const STOPPED = "program.stopped";
const NEGATIVE = /^-(?=\d+(\.\d+)?( ?(°|%|mm|m|rad|s))?$)/;

/** Return whether only one kind of controllers has a code. */
export const isOfKind = (code: string): boolean => `reason.${code}` in OF_KINDS.zh;

/** A reason's sentence in the page's language; `text` where it has none. */
export function reasonText(reason: Reason | undefined, text = reason?.text ?? ""): string {
  return (reason && sentence(reason)) ?? text;
}

/** Reasons as one text; `text` where there are none. */
export function reasonsText(reasons: readonly Reason[] = [], text = ""): string {
  return reasons.length > 0 ? reasons.map((reason) => reasonText(reason)).join(t("list_separator")) : text;
}

/** Return a reason with another value, also in its English sentence. */
export function withValue(reason: Reason, name: string, value: string): Reason {
  const { values, text } = reason;
  return { ...reason, values: { ...values, [name]: value }, text: text.replace(values[name] || value, () => value) };
}

/** Undefined: the code is unknown, or a parameter did not fit into the answer. */
function sentence(reason: Reason): string | undefined {
  const { code, values } = reason;
  if (code === STOPPED && values.by && !isSaid(values.reason)) return t("stopped_without_reason", { by: values.by });
  return language.value === "en" ? inEnglish(reason) : translated(reason);
}

function translated({ code, values, causes }: Reason): string | undefined {
  const key = `reason.${code}`;
  const template = message(key) ?? SENTENCES_OF_KINDS[language.value]?.[key];
  if (!template) return undefined;
  const shown = Object.fromEntries(
    Object.entries(values).map(([name, value]) => [
      name,
      wordsOf(name, value) ?? (template.includes(`= {${name}}`) ? isolated(value) : shownValue(value)),
    ]),
  );
  const known = causes.map((cause) => sentence(cause) ?? isolated(cause.text));
  if (known.length > 0 && known.every(Boolean)) shown.cause = known.join(t("list_separator"));
  return placeholders(template).every((name) => shown[name]) ? filled(template, shown, String) : undefined;
}

/** Return the catalogue's words for a value, whose last word may be a robot; undefined: it has none. */
function wordsOf(name: string, value: string): string | undefined {
  const key = `reason_value.${name}:${value}`;
  const words = message(key) ?? message(key.replace(/\S+$/, "{robot}"));
  return words && filled(words, { robot: value.split(" ").at(-1) ?? "" });
}

/** Return the reason's own sentence, with its values as the page shows them; a line to be typed keeps its numbers. */
function inEnglish(reason: Reason): string | undefined {
  const changed = new Map(valuesOf(reason).map((value) => [value, shownValue(value)] as const));
  for (const [value, shown] of changed) if (value === shown) changed.delete(value);
  const text = reason.text || undefined;
  if (changed.size === 0) return text;
  const longestFirst = [...changed.keys()].sort((one, other) => other.length - one.length);
  const any = longestFirst.map((value) => value.replace(/[\\^$.*+?()[\]{}|]/g, "\\$&")).join("|");
  return text?.replace(new RegExp(`(?<![\\w.]|= (?=-))(?:${any})(?!\\d)`, "g"), (value) => changed.get(value) ?? value);
}

const valuesOf = ({ values, causes }: Reason): string[] => [...Object.values(values), ...causes.flatMap(valuesOf)];

/** Return a value of another author isolated; a number has the page's minus sign. */
const shownValue = (value: string): string => isolated(value.replace(NEGATIVE, "−"));
