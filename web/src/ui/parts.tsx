// Small components that every page uses.

import type { ComponentChildren } from "preact";
import { staleText } from "../i18n/format";
import { t } from "../i18n/texts";
import type { Notice } from "../mesh/control";
import type { StateWord } from "../mesh/robot-state";

/** A panel with a heading; `end` is right of the heading. */
export function Panel(props: { title: string; name: string; end?: ComponentChildren; children: ComponentChildren }) {
  return (
    <section class={`panel ${props.name}`} aria-label={props.title}>
      <div class="panel-head">
        <h2>{props.title}</h2>
        <div class="panel-end">{props.end}</div>
      </div>
      {props.children}
    </section>
  );
}

/** The outcome of an action, next to the action; it keeps its height when empty. */
export function NoticeLine({ notice, idle }: { notice: Notice | null; idle?: string }) {
  const bad = notice?.kind === "refused" || notice?.kind === "lost";
  return (
    <p class={`notice ${notice?.kind ?? "idle"}`} role={bad ? "alert" : "status"}>
      {bad && <span class="shape warning" aria-hidden="true" />}
      {notice?.text ?? idle ?? "\u00a0"}
      {notice?.warning && (
        <span class="notice-warning">
          <span class="shape warning" aria-hidden="true" />
          {t("warning_of_check", { text: notice.warning })}
        </span>
      )}
    </p>
  );
}

/** A unit after its number: the degree sign close and as large, words smaller and apart. */
export function Unit({ of: unit }: { of: string }) {
  return <span class={unit === "°" ? "unit degree" : "unit"}>{unit}</span>;
}

/** A state word with the shape and colour of its level; of several, their number. */
export function State({ state, count }: { state: StateWord; count?: number }) {
  return (
    <span class={`state ${state.level}`}>
      <span class={`shape ${state.level}`} aria-hidden="true" />
      {count !== undefined && `${count} `}
      {t(state.word)}
    </span>
  );
}

/** Nothing while fresh, the age in words when stale. */
export function Age({ stale, age }: { stale: boolean; age: number | null }) {
  return stale ? <span class="age">{staleText(age)}</span> : null;
}

export function Tag({ kind, children }: { kind: string; children: ComponentChildren }) {
  return <span class={`tag ${kind}`}>{children}</span>;
}

/** Buttons, one of which is chosen. */
export function Choice<Value extends string>(props: {
  label: string;
  values: readonly Value[];
  chosen: Value;
  text: (value: Value) => string;
  choose: (value: Value) => void;
}) {
  return (
    <div class="choice" role="group" aria-label={props.label}>
      {props.values.map((value) => (
        <button key={value} aria-pressed={value === props.chosen} onClick={() => props.choose(value)}>
          {props.text(value)}
        </button>
      ))}
    </div>
  );
}

export function Toggle(props: { on: boolean; set: (on: boolean) => void; children: ComponentChildren }) {
  return (
    <button class="toggle" aria-pressed={props.on} onClick={() => props.set(!props.on)}>
      {props.children}
    </button>
  );
}

/** A drawing in the place of a missing picture. */
export function Silhouette({ label }: { label: string }) {
  return (
    <svg viewBox="0 0 160 90" class="silhouette" role="img" aria-label={label}>
      <path d="M50 80h38M68 80V56l26-24 24 16" />
      <circle cx="68" cy="54" r="6" />
      <circle cx="94" cy="32" r="5" />
      <circle cx="118" cy="48" r="4" />
    </svg>
  );
}
