// The toolbar above the text: name, files, undo and redo.

import { useRef } from "preact/hooks";
import type { Words } from "../../i18n/program";
import { p } from "../../i18n/program";
import { canRedo, canUndo, download, draft, FILE_ENDING, redo, rename, replace, undo } from "./draft";
import { description } from "./program-robot";
import { example } from "./program-text";
import "./toolbar.css";

const LARGEST = 64 * 1024; // the check's maximum

export function Toolbar({ tell }: { tell: (words: Words) => void }) {
  const input = useRef<HTMLInputElement>(null);
  const now = draft.value;
  const begin = () => {
    if (!description.value) return;
    replace(example(description.value, p("example_comment")));
    tell(() => p("replaced"));
  };
  const openFile = async (file: File) => {
    if (file.size > LARGEST) return tell(() => p("too_large", { name: file.name, size: Math.ceil(file.size / 1024) }));
    const text = await file.text();
    if (text.includes("\0")) return tell(() => p("no_text", { name: file.name }));
    replace(text.replace(/\r\n?/g, "\n"));
    rename(file.name.replace(/\.[^.]*$/, ""));
    tell(() => p("opened", { name: file.name }));
  };
  return (
    <div class="program-tools" role="toolbar" aria-label={p("file")}>
      <label class="program-name">
        <span class="dim small">{p("name")}</span>
        <input
          type="text"
          autocomplete="off"
          spellcheck={false}
          maxLength={60}
          value={now?.name ?? ""}
          disabled={!now}
          onInput={(event) => rename(event.currentTarget.value)}
        />
      </label>
      <div class="program-buttons">
        <button class="action" onClick={begin} disabled={!now || !description.value} title={p("new_hint")}>
          {p("new")}
        </button>
        <button class="action" disabled={!now} onClick={() => input.current?.click()}>
          {p("open")}
        </button>
        <button class="action" onClick={download} disabled={!now?.text} title={p("save_hint")}>
          {p("save")}
        </button>
        <button class="action" disabled={!canUndo.value} onClick={undo}>
          {p("undo")}
        </button>
        <button class="action" disabled={!canRedo.value} onClick={redo}>
          {p("redo")}
        </button>
      </div>
      <input
        ref={input}
        class="file-input"
        type="file"
        accept={`${FILE_ENDING},.txt,text/plain`}
        tabIndex={-1}
        aria-label={p("open")}
        onChange={(event) => {
          const file = event.currentTarget.files?.[0];
          if (file) void openFile(file).finally(() => input.current && (input.current.value = ""));
        }}
      />
    </div>
  );
}
