// The toolbar: name, undo and redo, save, download, start; and the outcome of actions.

import { useState } from "preact/hooks";
import { whenText } from "../../../i18n/format";
import { defineText as d, t } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { robotLink } from "../../../ui/page/route";
import { outcomeRole } from "../../../ui/panel/notice-line";
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
} from "../draft/draft";
import { busy, download, isRunning, knownRobots, outcome, save, start, stop } from "../draft/save-and-start";
import { fileNotices, reading } from "../opening/dropped-files";
import { discardDraft } from "../opening/open-robot";

export function Toolbar() {
  const now = draft.value;
  if (!now) return null;
  const { name, title } = now.description;
  const { siteName } = identity.value;
  const canStart = knownRobots.value?.can_start ?? false;
  const state = isUnsaved.value ? (siteName ? "unsaved" : "not_yet_saved") : siteName ? "all_saved" : "no_changes";
  const running = isRunning();
  return (
    <div class="row wrap tall-40 gap-8" role="toolbar" aria-label={d("define")}>
      <div class="toolbar-name flex baseline narrow gap-12 pad-0-8">
        <h1>{title || name || d("define")}</h1>
        <span class={`save-state nowrap small dim ${isUnsaved.value ? "unsaved" : ""}`} role="status">
          {busy.value || reading.value || d(state)}
        </span>
      </div>
      <div class="toolbar-group flex wrap gap-8">
        <Button text={d("undo")} disabled={!canUndo.value} onClick={undo} title={`${d("undo")} (Ctrl+Z)`} />
        <Button text={d("redo")} disabled={!canRedo.value} onClick={redo} title={`${d("redo")} (Ctrl+Shift+Z)`} />
      </div>
      <div class="toolbar-group flex wrap gap-8">
        {/* biome-ignore lint/a11y/useValidAnchor: it navigates; the click clears the draft first. */}
        <a class="action" href="#/define" onClick={startNewDraft}>
          {d("new")}
        </a>
        <Button text={d("download")} disabled={busy.value !== ""} onClick={() => void download()} />
        {running ? (
          <Button text={d("stop_simulated")} disabled={busy.value !== ""} onClick={() => void stop()} />
        ) : (
          <Button
            text={d(isUnsaved.value || !siteName ? "save_start" : "start")}
            disabled={busy.value !== "" || !canStart}
            title={canStart ? "" : d("cannot_start")}
            onClick={() => void start()}
          />
        )}
        <Button
          primary
          text={d("save")}
          disabled={busy.value !== "" || (!isUnsaved.value && siteName !== "")}
          onClick={() => void save(false)}
          title="Ctrl+S"
        />
      </div>
    </div>
  );
}

/** Outcomes, one line each, which the user dismisses. */
export function Outcomes() {
  const [sure, setSure] = useState(false);
  const done = outcome.value;
  return (
    <div class="outcomes stack gap-4">
      {restoredFrom.value !== null && draft.value && (
        <div class="outcome" role="status">
          <span>{sure ? d("discard_sure") : d("brought_back", { time: whenText(restoredFrom.value) })}</span>
          {sure ? (
            <>
              <button class="action small-action" onClick={discardDraft}>
                {d("discard")}
              </button>
              <Button quiet text={d("cancel")} onClick={() => setSure(false)} />
            </>
          ) : (
            <>
              <Button quiet text={d("discard")} onClick={() => setSure(true)} />
              <Button quiet text={d("keep")} onClick={() => (restoredFrom.value = null)} />
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
          <Button quiet text={d("cancel")} onClick={() => (outcome.value = null)} />
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
      <ul class="file-notices narrow scroll break" tabIndex={0} aria-label={d("about_files")}>
        {[...refused, ...others].map(({ text }) => (
          <li key={text}>{text}</li>
        ))}
      </ul>
      <Button quiet text={t("dismiss")} onClick={() => (fileNotices.value = [])} />
    </div>
  );
}

function Close() {
  return <Button quiet text={t("dismiss")} onClick={() => (outcome.value = null)} />;
}
