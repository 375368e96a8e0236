// The kinematic chain as a list: the base, each joint with its link, the tool.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { d } from "../../i18n/define";
import { problemsAt } from "./checks";
import type { Joint } from "./description";
import { linkName } from "./description";
import { draft, editDraft } from "./draft";
import { insertJoint, moveJoint, removeJoint } from "./edits";
import type { Part } from "./selection";
import { choosePart, chosenPart } from "./selection";

function add(at: number): void {
  editDraft((now) => void insertJoint(now.description, at));
  choosePart(at);
}

function move(from: number, to: number, count: number): void {
  if (to < 0 || to >= count || to === from) return;
  editDraft((now) => moveJoint(now.description, from, to));
  choosePart(to);
}

function remove(at: number, count: number): void {
  editDraft((now) => removeJoint(now.description, at));
  choosePart(count > 1 ? Math.min(at, count - 2) : "base");
}

export function KinematicChain() {
  const [dragged, setDragged] = useState<number | null>(null);
  const [over, setOver] = useState<number | null>(null);
  const now = draft.value;
  if (!now) return null;
  const { joint: joints, base } = now.description;
  const count = joints.length;
  const selected = typeof chosenPart.value === "number" ? chosenPart.value : null;
  const end = () => {
    setDragged(null);
    setOver(null);
  };
  return (
    <section class="panel chain" aria-label={d("chain")}>
      <div class="panel-head">
        <h2>{d("chain")}</h2>
        <button class="quiet" onClick={() => add(count)}>
          + {d("add_joint")}
        </button>
      </div>
      <ol class="chain-list" title={d("chain_hint")}>
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
            class={`chain-item ${over === index && dragged !== null ? (dragged < index ? "drop-below" : "drop-above") : ""}`}
            draggable
            onDragStart={(event) => {
              event.dataTransfer?.setData("text/plain", joint.name);
              setDragged(index);
            }}
            onDragOver={(event) => {
              if (dragged === null) return;
              event.preventDefault();
              setOver(index);
            }}
            onDragEnd={end}
            onDrop={(event) => {
              if (dragged === null) return;
              event.preventDefault();
              event.stopPropagation();
              move(dragged, index, count);
              end();
            }}
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
      <div class="chain-tools" role="group" aria-label={d("chain")}>
        <button
          class="quiet"
          disabled={selected === null}
          title={d("insert_before")}
          onClick={() => add(selected ?? 0)}
        >
          {d("insert")}
        </button>
        <button
          class="quiet sign"
          disabled={selected === null || selected === 0}
          aria-label={d("move_up")}
          title={`${d("move_up")} (Alt+↑)`}
          onClick={() => move(selected ?? 0, (selected ?? 0) - 1, count)}
        >
          ↑
        </button>
        <button
          class="quiet sign"
          disabled={selected === null || selected === count - 1}
          aria-label={d("move_down")}
          title={`${d("move_down")} (Alt+↓)`}
          onClick={() => move(selected ?? 0, (selected ?? 0) + 1, count)}
        >
          ↓
        </button>
        <button class="quiet" disabled={selected === null} onClick={() => remove(selected ?? 0, count)}>
          {d("remove")}
        </button>
      </div>
    </section>
  );
}

function focusRow(index: number): void {
  requestAnimationFrame(() => document.querySelector<HTMLElement>(`.chain-row[data-part="${index}"]`)?.focus());
}

function Row(props: Parameters<typeof RowButton>[0]) {
  return (
    <li class="chain-item">
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
      class="chain-row"
      data-part={String(props.part)}
      aria-current={chosenPart.value === props.part}
      onClick={() => choosePart(props.part)}
    >
      <span class="chain-mark" aria-hidden="true">
        {props.mark}
      </span>
      <span class="chain-words">
        <strong>{props.name}</strong>
        <span class={`dim ${props.faint ? "faint" : ""}`}>{props.facts}</span>
      </span>
      {wrong && <span class="shape warning" role="img" aria-label={wrong.text} title={wrong.text} />}
      {props.end}
    </button>
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

export function fileName(path: string): string {
  return path.split("/").at(-1) ?? path;
}
