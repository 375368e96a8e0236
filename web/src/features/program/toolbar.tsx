// The toolbar above the text: name, saving, the site's programs, files, undo and redo; and the saved state.

import type { Words } from "../../i18n/texts";
import { programText as p, storedText as s } from "../../i18n/texts";
import { mayAct } from "../../mesh/console/account";
import { Button } from "../../ui/inputs/button";
import { FileButton } from "../../ui/inputs/file-button";
import { TextInput } from "../../ui/inputs/text-input";
import {
  canRedo,
  canUndo,
  download,
  draft,
  FILE_ENDING,
  isUnsaved,
  redo,
  rename,
  startProgram,
  undo,
} from "./draft/draft";
import { readProgramFile } from "./draft/program-files";
import { example } from "./draft/program-text";
import { description } from "./motion/program-robot";
import {
  isDeleted,
  lastAction,
  programOfDraft,
  save,
  saving,
  shown,
  showVersion,
  stored,
  timeOf,
  unusedProgramName,
} from "./stored/stored-programs";
import "./toolbar.css";

export function Toolbar({ tell }: { tell: (words: Words) => void }) {
  const now = draft.value;
  const begin = () => {
    if (!description.value) return;
    startProgram(example(description.value, p("example_comment")), unusedProgramName());
    shown.value = null;
    tell(() => p("replaced"));
  };
  const openFile = async (file: File) => {
    const found = await readProgramFile(file);
    if ("problem" in found) {
      const values = { name: file.name, size: Math.ceil(file.size / 1024) };
      return tell(() => p(found.problem, values));
    }
    startProgram(found.text, found.name);
    shown.value = null;
    tell(() => p("opened", { name: file.name }));
  };
  const isNew = !now?.base || now.base.name !== now.name;
  return (
    <>
      <div class="program-tools flex wrap gap-8" role="toolbar" aria-label={p("file")}>
        <label class="program-name">
          <span class="dim small">{p("name")}</span>
          <TextInput maxLength={60} value={now?.name ?? ""} disabled={!now} set={rename} />
        </label>
        <div class="program-buttons flex wrap gap-8">
          <Button
            primary
            text={s(now?.base && isNew ? "save_as" : "save")}
            onClick={() => void save()}
            disabled={!now?.text || saving.value || !mayAct.value || (!isUnsaved.value && now.base !== null)}
            title={mayAct.value ? s("save_hint") : s("monitor")}
          />
          <Button
            text={s("programs")}
            aria-pressed={shown.value !== null}
            title={s("programs_hint")}
            onClick={() => {
              shown.value = shown.value ? null : { kind: "list" };
            }}
          />
          <Button text={p("new")} onClick={begin} disabled={!now || !description.value} title={p("new_hint")} />
          <FileButton
            label={p("open")}
            disabled={!now}
            accept={`${FILE_ENDING},.txt,text/plain`}
            take={([file]) => file && void openFile(file)}
          />
          <Button
            text={p("save")}
            onClick={() => now && download(now.text, now.name)}
            disabled={!now?.text}
            title={p("save_hint")}
          />
          <Button text={p("undo")} disabled={!canUndo.value} onClick={undo} />
          <Button text={p("redo")} disabled={!canRedo.value} onClick={redo} />
        </div>
      </div>
      <StoreLine />
    </>
  );
}

/** The draft compared with the stored program. Its height is fixed: nothing below moves. */
function StoreLine() {
  const now = draft.value;
  const program = programOfDraft.value;
  const current = program?.current;
  const base = now?.base;
  const isNewer = base && current && (current.number > base.version || isDeleted(program));
  const said = lastAction.value;
  const words = said.words() || (now ? stateOfDraft() : "");
  const state = { role: said.refused ? "alert" : "status", "aria-label": s("saved_state") } as const;
  return (
    <p class="store-line">
      <span
        class={`store-words ${said.words() && said.refused ? "refused" : isNewer ? "newer" : "dim"}`}
        {...state}
        title={words}
      >
        {words || "\u00a0"}
      </span>
      {isNewer && now && (
        <Button
          quiet
          text={s("compare")}
          onClick={() => void showVersion(now.robotKey, base.id, 0, isUnsaved.value ? null : base.version)}
        />
      )}
    </p>
  );
}

function stateOfDraft(): string {
  const base = draft.value?.base;
  const program = programOfDraft.value;
  const current = program?.current;
  if (!stored.value) return s("no_store");
  if (!base || !program || !current) return draft.value?.text ? s("never_saved") : "";
  const values = { author: current.author, version: current.number, time: timeOf(current), reason: current.reason };
  if (isDeleted(program)) return s("gone", values);
  if (current.number > base.version) return s(isUnsaved.value ? "newer_unsaved" : "newer", values);
  return isUnsaved.value ? s("unsaved", { version: base.version }) : s("is_saved", values);
}
