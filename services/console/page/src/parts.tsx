// Small parts that every screen uses.

import type { ComponentChildren } from "preact";
import type { Notice } from "./control";
import { staleText } from "./format";
import type { StateWord } from "./robot-state";
import { t } from "./texts";

/** A panel with a heading; `end` stands right of the heading. */
export function Panel(props: {
  title: string;
  name: string;
  end?: ComponentChildren;
  children: ComponentChildren;
}) {
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

/** What became of an action, where the action was; it keeps its place when empty. */
export function NoticeLine({ notice, idle }: { notice: Notice | null; idle?: string }) {
  return (
    <p class={`notice ${notice?.kind ?? "idle"}`} role={notice?.kind === "refused" ? "alert" : "status"}>
      {notice?.kind === "refused" && <span class="shape warning" aria-hidden="true" />}
      {notice?.text ?? idle ?? "\u00a0"}
    </p>
  );
}

/** A unit after its number: the degree sign close to it and as large, words smaller and apart. */
export function Unit({ of: unit }: { of: string }) {
  return <span class={unit === "°" ? "unit degree" : "unit"}>{unit}</span>;
}

/** A state word with the shape and colour of its level. */
export function State({ state }: { state: StateWord }) {
  return (
    <span class={`state ${state.level}`}>
      <span class={`shape ${state.level}`} aria-hidden="true" />
      {t(state.word)}
    </span>
  );
}

/** Nothing while fresh; how old, in words, when not. */
export function Age({ stale, age }: { stale: boolean; age: number | null }) {
  return stale ? <span class="age">{staleText(age)}</span> : null;
}

export function Tag({ kind, children }: { kind: string; children: ComponentChildren }) {
  return <span class={`tag ${kind}`}>{children}</span>;
}

/** Buttons of which one is chosen. */
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
