// The toolbar: name, undo and redo, save, download, start; and the outcome of actions.

import { useState } from "preact/hooks";
import { d } from "../../i18n/define";
import { whenText } from "../../i18n/format";
import { t } from "../../i18n/texts";
import { outcomeRole } from "../../ui/notice-line";
import { robotLink } from "../../ui/route";
import {
  canRedo,
  canUndo,
  draft,
  identity,
  isUnsaved,
  redo,
  restoredFrom,
  startNewDraft,
  storageError,
  undo,
} from "./draft";
import { fileNotices, reading } from "./dropped-files";
import { discardDraft } from "./open-robot";
import { busy, download, isRunning, knownRobots, outcome, save, start, stop } from "./save-and-start";

export function Toolbar() {
  const now = draft.value;
  if (!now) return null;
  const { name, title } = now.description;
  const { siteName } = identity.value;
  const canStart = knownRobots.value?.can_start ?? false;
  const state = isUnsaved.value ? (siteName ? "unsaved" : "not_yet_saved") : siteName ? "all_saved" : "no_changes";
  const running = isRunning();
  return (
    <div class="toolbar" role="toolbar" aria-label={d("define")}>
      <div class="toolbar-name">
        <h1>{title || name || d("define")}</h1>
        <span class={`save-state ${isUnsaved.value ? "unsaved" : ""}`} role="status">
          {busy.value || reading.value || d(state)}
        </span>
      </div>
      <div class="toolbar-group">
        <button class="action" disabled={!canUndo.value} onClick={undo} title={`${d("undo")} (Ctrl+Z)`}>
          {d("undo")}
        </button>
        <button class="action" disabled={!canRedo.value} onClick={redo} title={`${d("redo")} (Ctrl+Shift+Z)`}>
          {d("redo")}
        </button>
      </div>
      <div class="toolbar-group">
        {/* biome-ignore lint/a11y/useValidAnchor: it navigates; the click clears the draft first. */}
        <a class="action" href="#/define" onClick={startNewDraft}>
          {d("new")}
        </a>
        <button class="action" disabled={busy.value !== ""} onClick={() => void download()}>
          {d("download")}
        </button>
        {running ? (
          <button class="action" disabled={busy.value !== ""} onClick={() => void stop()}>
            {d("stop_simulated")}
          </button>
        ) : (
          <button
            class="action"
            disabled={busy.value !== "" || !canStart}
            title={canStart ? "" : d("cannot_start")}
            onClick={() => void start()}
          >
            {d(isUnsaved.value || !siteName ? "save_start" : "start")}
          </button>
        )}
        <button
          class="action primary"
          disabled={busy.value !== "" || (!isUnsaved.value && siteName !== "")}
          onClick={() => void save(false)}
          title="Ctrl+S"
        >
          {d("save")}
        </button>
      </div>
    </div>
  );
}

/** Outcomes, one line each, which the user dismisses. */
export function Outcomes() {
  const [sure, setSure] = useState(false);
  const done = outcome.value;
  return (
    <div class="outcomes">
      {restoredFrom.value !== null && draft.value && (
        <div class="outcome" role="status">
          <span>{sure ? d("discard_sure") : d("brought_back", { time: whenText(restoredFrom.value) })}</span>
          {sure ? (
            <>
              <button class="action small-action" onClick={discardDraft}>
                {d("discard")}
              </button>
              <button class="quiet" onClick={() => setSure(false)}>
                {d("cancel")}
              </button>
            </>
          ) : (
            <>
              <button class="quiet" onClick={() => setSure(true)}>
                {d("discard")}
              </button>
              <button class="quiet" onClick={() => (restoredFrom.value = null)}>
                {d("keep")}
              </button>
            </>
          )}
        </div>
      )}
      {storageError.value && (
        <p class="outcome refused" {...outcomeRole(true)}>
          {d("not_kept", { text: storageError.value })}
        </p>
      )}
      {done?.kind === "exists" && (
        <div class="outcome" role="alertdialog" aria-label={d("save_over")}>
          <span class="shape warning" aria-hidden="true" />
          <span>{done.text}</span>
          <button class="action small-action" onClick={() => void save(done.thenStart, done.name)}>
            {d("save_over")}
          </button>
          <button class="quiet" onClick={() => (outcome.value = null)}>
            {d("cancel")}
          </button>
        </div>
      )}
      {done?.kind === "started" && (
        <div class="outcome done" {...outcomeRole(false)}>
          <span>{d("started", { name: done.robot })}</span>
          <a class="action small-action" href={robotLink(done.site, done.robot)}>
            {d("watch_it")}
          </a>
          <Close />
        </div>
      )}
      {(done?.kind === "done" || done?.kind === "refused") && (
        <div class={`outcome ${done.kind}`} {...outcomeRole(done.kind === "refused")}>
          {done.kind === "refused" && <span class="shape warning" aria-hidden="true" />}
          <span>{done.text}</span>
          <Close />
        </div>
      )}
      <FileNotices />
    </div>
  );
}

/** What became of dropped files: refusals first, all in one box, so that many leave room for the robot. */
function FileNotices() {
  const refused = fileNotices.value.filter(({ kind }) => kind === "refused");
  const others = fileNotices.value.filter(({ kind }) => kind !== "refused");
  if (fileNotices.value.length === 0) return null;
  return (
    <div class={`outcome ${refused.length ? "refused" : "done"}`} {...outcomeRole(refused.length > 0)}>
      {refused.length > 0 && <span class="shape warning" aria-hidden="true" />}
      <ul class="file-notices" tabIndex={0} aria-label={d("about_files")}>
        {[...refused, ...others].map(({ text }) => (
          <li key={text}>{text}</li>
        ))}
      </ul>
      <button class="quiet" onClick={() => (fileNotices.value = [])}>
        {t("dismiss")}
      </button>
    </div>
  );
}

function Close() {
  return (
    <button class="quiet" onClick={() => (outcome.value = null)}>
      {t("dismiss")}
    </button>
  );
}
