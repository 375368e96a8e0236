// The program's text: a plain text field over its coloured lines, with line numbers and marks.

import { Component } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";
import { programText as p } from "../../i18n/texts";
import { Panel } from "../../ui/panel/panel";
import { draft, insert, LINE_PX, recordTyping, redo, setField, storageError, undo } from "./draft/draft";
import { highlightSyntax } from "./draft/program-text";
import { lineAtMoment } from "./motion/checked-motion";
import { checked, isCurrent } from "./motion/program-check";
import { runningLine } from "./motion/running-program";
import { severityOf } from "./motion/violations";
import { save } from "./stored/stored-programs";
import "./editor.css";

type Mark = "shown" | "warning" | "alarm" | "running";

const SIGNS: Record<Mark, string> = { shown: "", warning: "▲", alarm: "■", running: "▶" };

export function Editor() {
  const field = useRef<HTMLTextAreaElement>(null);
  const key = draft.value?.robotKey;
  useLayoutEffect(() => {
    // After mounting, write the field's value only where the page changes the text itself.
    if (field.current) field.current.value = draft.value?.text ?? "";
    setField(field.current);
    return () => setField(null);
  }, [key]);
  const lines = (draft.value?.text ?? "").split("\n");
  const digits = String(lines.length).length;
  return (
    <Panel
      name="editor-panel"
      title={p("text")}
      end={<span class="dim small">{p(lines.length === 1 ? "one_line" : "lines", { count: lines.length })}</span>}
    >
      <div class="editor grow ruled" style={{ "--digits": String(digits) }}>
        <div class="editor-lines flex anchor">
          {[...marksOf(lines)].map(([line, mark]) => (
            <div key={line} class={`editor-band ${mark}`} style={{ top: `${8 + (line - 1) * LINE_PX}px` }}>
              <span class="editor-sign" aria-hidden="true">
                {SIGNS[mark]}
              </span>
            </div>
          ))}
          <pre class="editor-numbers rigid dim right" aria-hidden="true">
            {lines.map((_, index) => String(index + 1).padStart(digits)).join("\n")}
          </pre>
          <pre class="editor-paint grow anchor" aria-hidden="true">
            {lines.map((line, index) => (
              <Line key={index} text={line} />
            ))}
          </pre>
          <textarea
            ref={field}
            class="editor-field"
            aria-label={p("text")}
            spellcheck={false}
            autocomplete="off"
            autocapitalize="off"
            wrap="off"
            readOnly={!draft.value}
            onInput={recordTyping}
            onBeforeInput={(event) => {
              const step = { historyUndo: undo, historyRedo: redo }[event.inputType];
              if (step) event.preventDefault(), step();
            }}
            onKeyDown={(event) => {
              const letter = event.ctrlKey || event.metaKey ? event.key.toLowerCase() : "";
              const action = letter === "z" ? (event.shiftKey ? redo : undo) : { y: redo, s: save }[letter];
              if (action && !event.altKey) event.preventDefault(), void action();
            }}
            onPaste={(event) => {
              // The browser's own layout takes seconds for a thousand lines.
              event.preventDefault();
              insert((event.clipboardData?.getData("text/plain") ?? "").replace(/\r\n?/g, "\n"));
            }}
          />
        </div>
      </div>
      {storageError.value && <p class="notice refused">{p("not_kept", { text: storageError.value })}</p>}
    </Panel>
  );
}

/** Marked lines with their marks; the running line has priority. */
function marksOf(lines: readonly string[]): ReadonlyMap<number, Mark> {
  const marks = new Map<number, Mark>();
  const running = runningLine(lines);
  if (running === null && lineAtMoment.value !== null) marks.set(lineAtMoment.value, "shown");
  for (const violation of isCurrent() ? (checked.value?.answer.violations ?? []) : []) {
    if (marks.get(violation.line) !== "alarm") marks.set(violation.line, severityOf(violation));
  }
  if (running !== null) marks.set(running, "running");
  return marks;
}

/** Rendered only on a change: a program may have thousands of lines. */
class Line extends Component<{ text: string }> {
  override shouldComponentUpdate(next: { text: string }): boolean {
    return next.text !== this.props.text;
  }

  override render() {
    return (
      <>
        {highlightSyntax(this.props.text).map(({ text, is }, index) =>
          is ? (
            <span key={index} class={is}>
              {text}
            </span>
          ) : (
            text
          ),
        )}
        {"\n"}
      </>
    );
  }
}
