// The kinematic chain as a list: the base, each joint with its link, the tool.

import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Panel } from "../../../ui/panel/panel";
import type { Description, Joint } from "../description/description";
import { linkName } from "../description/description";
import { insertJoint, makeBase, moveJoint, removeJoint } from "../description/edits";
import { fileName } from "../description/paths";
import { problemsAt } from "../draft/checks";
import { draft, editDraft } from "../draft/draft";
import type { Part } from "../draft/selection";
import { choosePart, chosenPart, sliderPositions } from "../draft/selection";

/** What the last change of the order was, for screen readers. */
const announced = signal("");
/** The joint that is being dragged, how far, and the row below the pointer; null: none. */
const dragged = signal<{ from: number; by: number; over: Part } | null>(null);
const DRAG_PX = 5; // a pointer that moves less is a click
const EDGE_PX = 32; // of the list, where it scrolls

/** Change the order of the joints in one step of undo. `order` does the same to a list; sliders stay with their joints. */
function arrange(change: (description: Description) => void, order: (list: unknown[]) => void): void {
  const before = draft.value?.description.joint ?? [];
  const sliders: unknown[] = before.map(({ name }) => sliderPositions.value.get(name));
  order(sliders);
  editDraft((now) => change(now.description));
  const after = draft.value?.description.joint ?? [];
  const kept = after.flatMap(({ name }, index): [string, number][] => {
    const position = sliders[index];
    return typeof position === "number" ? [[name, position]] : [];
  });
  sliderPositions.value = new Map(kept);
}

function announce(at: number): void {
  const joints = draft.value?.description.joint ?? [];
  announced.value = d("now_at", { name: joints[at]?.name ?? "", number: at + 1, count: joints.length });
}

function add(at: number): void {
  arrange(
    (description) => void insertJoint(description, at),
    (list) => list.splice(at, 0, undefined),
  );
  choosePart(at);
  announce(at);
}

function move(from: number, to: number, count: number): void {
  if (to < 0 || to >= count || to === from) return;
  arrange(
    (description) => moveJoint(description, from, to),
    (list) => list.splice(to, 0, ...list.splice(from, 1)),
  );
  choosePart(to);
  announce(to);
}

function remove(at: number, count: number): void {
  const name = draft.value?.description.joint[at]?.name ?? "";
  arrange(
    (description) => removeJoint(description, at),
    (list) => list.splice(at, 1),
  );
  choosePart(count > 1 ? Math.min(at, count - 2) : "base");
  announced.value = d("is_removed", { name });
}

/** Make a link the base, in place of the present one. */
function rebase(at: number): void {
  editDraft((now) => makeBase(now.description, at));
  choosePart("base");
  announced.value = d("is_base", { name: fileName(draft.value?.description.base.mesh ?? "") });
}

/** Drag a row by the mouse anywhere on it, by a finger at its handle: elsewhere a finger scrolls. */
function startDrag(event: PointerEvent & { currentTarget: HTMLElement }, from: number, count: number): void {
  const byHandle = (event.target as Element).closest(".chain-handle") !== null;
  if (event.button !== 0 || !event.isPrimary || (event.pointerType !== "mouse" && !byHandle)) return;
  const list = event.currentTarget.parentElement;
  const [start, scrolled] = [event.clientY, list?.scrollTop ?? 0];
  const ending = new AbortController();
  const options = { signal: ending.signal };
  const end = () => {
    ending.abort();
    dragged.value = null;
  };
  const onMove = ({ clientY }: PointerEvent) => {
    if (!list || (!dragged.value && Math.abs(clientY - start) < DRAG_PX)) return;
    const box = list.getBoundingClientRect();
    if (clientY < box.top + EDGE_PX) list.scrollTop -= 8;
    if (clientY > box.bottom - EDGE_PX) list.scrollTop += 8;
    const rows = [...list.querySelectorAll<HTMLElement>("[data-row]")];
    const slots = rows.map((each) => each.offsetTop + each.offsetHeight / 2);
    const at = clientY - list.getBoundingClientRect().top + list.scrollTop;
    // The row whose middle is nearest; the first is the base.
    const near = slots.reduce(
      (best, slot, index) => (Math.abs(slot - at) < Math.abs((slots[best] ?? 0) - at) ? index : best),
      0,
    );
    const over: Part = near === 0 ? "base" : near - 1;
    dragged.value = { from, by: clientY - start + list.scrollTop - scrolled, over };
  };
  addEventListener("pointermove", onMove, options);
  addEventListener(
    "pointerup",
    () => {
      const over = dragged.value?.over;
      if (dragged.value) ignoreClick();
      end();
      if (over === "base") rebase(from);
      else if (typeof over === "number") move(from, over, count);
    },
    options,
  );
  addEventListener("pointercancel", end, options);
  addEventListener("keydown", ({ key }) => key === "Escape" && end(), options);
}

/** Ignore the click that follows a drag: it would choose the row where the drag began. */
function ignoreClick(): void {
  const stop = (event: Event) => event.stopPropagation();
  addEventListener("click", stop, { capture: true });
  setTimeout(() => removeEventListener("click", stop, { capture: true }));
}

function dropClass(part: Part): string {
  const drag = dragged.value;
  if (!drag) return "";
  if (drag.from === part) return "dragged";
  if (drag.over !== part) return "";
  return part === "base" ? "drop-on" : drag.from < (part as number) ? "drop-below" : "drop-above";
}

export function KinematicChain() {
  const now = draft.value;
  if (!now) return null;
  const { joint: joints, base } = now.description;
  const count = joints.length;
  const isJoint = typeof chosenPart.value === "number";
  const at = isJoint ? (chosenPart.value as number) : 0;
  return (
    <Panel
      name="chain"
      title={d("chain")}
      end={<Button quiet text={`+ ${d("add_joint")}`} onClick={() => add(count)} />}
    >
      <ol class="chain-list scroll pad-0-8 anchor" aria-label={d("chain")} title={d("chain_hint")}>
        <Row
          part="base"
          mark="0"
          name={d("base")}
          facts={base.mesh ? fileName(base.mesh) : d("no_shape")}
          faint={!base.mesh}
          path="base"
        />
        {joints.map((joint, index) => (
          <li
            key={index}
            data-row={index}
            class={`chain-item row ${dropClass(index)}`}
            style={dragged.value?.from === index ? { transform: `translateY(${dragged.value.by}px)` } : {}}
            onPointerDown={(event) => startDrag(event, index, count)}
            onKeyDown={(event) => {
              const by = event.altKey ? { ArrowUp: -1, ArrowDown: 1 }[event.key] : undefined;
              if (by) {
                event.preventDefault();
                move(index, index + by, count);
                focusRow(Math.max(0, Math.min(count - 1, index + by)));
              } else if (event.key === "Delete") {
                remove(index, count);
                focusRow(Math.min(index, count - 2));
              }
            }}
          >
            <RowButton
              part={index}
              mark={String(index + 1)}
              name={joint.name || "–"}
              facts={factsOf(joint)}
              faint={!joint.link.mesh}
              path={`joint/${index}`}
              end={<JointSign joint={joint} />}
            />
            <Handle />
          </li>
        ))}
        <Row
          part="tool"
          mark={<ToolMark />}
          name={d("tool")}
          facts={now.description.tool.xyz.map((value) => Math.round(value * 100) / 100).join(" · ")}
          faint={false}
          path="tool"
        />
      </ol>
      <p class="unseen" role="status">
        {announced.value}
      </p>
      <div class="chain-tools flex ruled pad-4-8" role="group" aria-label={d("chain_tools")}>
        <Button quiet text={d("insert")} disabled={!isJoint} title={d("insert_before")} onClick={() => add(at)} />
        {([-1, 1] as const).map((by) => (
          <button
            key={by}
            class="quiet sign"
            disabled={!isJoint || at + by < 0 || at + by >= count}
            aria-label={d(by < 0 ? "move_up" : "move_down")}
            title={by < 0 ? `${d("move_up")} (Alt+↑)` : `${d("move_down")} (Alt+↓)`}
            onClick={() => move(at, at + by, count)}
          >
            {by < 0 ? "↑" : "↓"}
          </button>
        ))}
        <Button quiet text={d("remove")} disabled={!isJoint} onClick={() => remove(at, count)} />
      </div>
    </Panel>
  );
}

function focusRow(index: number): void {
  requestAnimationFrame(() => document.querySelector<HTMLElement>(`.chain-row[data-part="${index}"]`)?.focus());
}

function Row(props: Parameters<typeof RowButton>[0]) {
  return (
    <li class={`chain-item row ${dropClass(props.part)}`} {...(props.part === "base" && { "data-row": "base" })}>
      <RowButton {...props} />
    </li>
  );
}

function RowButton(props: {
  part: Part;
  mark: ComponentChildren;
  name: string;
  facts: string;
  faint: boolean;
  path: string;
  end?: ComponentChildren;
}) {
  const wrong = problemsAt(props.path)[0];
  return (
    <button
      class="chain-row pick row tall-44 gap-12"
      data-part={String(props.part)}
      aria-current={chosenPart.value === props.part}
      onClick={() => choosePart(props.part)}
    >
      <span class="chain-mark rigid dim" aria-hidden="true">
        {props.mark}
      </span>
      <span class="chain-words grid grow narrow">
        <strong>{props.name}</strong>
        <span class={`dim ${props.faint ? "faint" : ""}`}>{props.facts}</span>
      </span>
      {wrong && <span class="shape warning" role="img" aria-label={wrong.text} title={wrong.text} />}
      {props.end}
    </button>
  );
}

/** Where a finger drags a row; keys and buttons do the same. */
function Handle() {
  return (
    <svg class="chain-handle" viewBox="0 0 20 20" width="20" height="20" aria-hidden="true">
      <title>{d("drag_hint")}</title>
      {[6, 10, 14].flatMap((y) => [7, 13].map((x) => <circle key={`${x} ${y}`} cx={x} cy={y} r="1.4" />))}
    </svg>
  );
}

function ToolMark() {
  return (
    <svg class="joint-sign" viewBox="0 0 20 20" width="18" height="18" aria-hidden="true">
      <path d="M10 2v4M10 14v4M2 10h4M14 10h4" />
      <circle cx="10" cy="10" r="4" />
    </svg>
  );
}

/** A ring for a rotary joint, an arrow for a prismatic one. */
function JointSign({ joint }: { joint: Joint }) {
  const word = d(joint.type);
  return (
    <svg class="joint-sign" viewBox="0 0 20 20" width="18" height="18" role="img" aria-label={word}>
      <title>{word}</title>
      {joint.type === "rotary" ? (
        <path d="M16 10a6 6 0 1 1-2-4.5M14 2v4h-4" />
      ) : (
        <path d="M2 10h16M5 7l-3 3 3 3M15 7l3 3-3 3" />
      )}
    </svg>
  );
}

function factsOf(joint: Joint): string {
  const file = joint.link.mesh ? fileName(joint.link.mesh) : d("no_shape");
  return linkName(joint) === joint.name ? file : `${linkName(joint)} · ${file}`;
}
