// The ways to begin, while there is no draft.

import { useEffect } from "preact/hooks";
import { whenText } from "../../../i18n/format";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { FileButton } from "../../../ui/inputs/file-button";
import { empty } from "../description/description";
import { insertJoint } from "../description/edits";
import { hasStoredDraft, newDrafts, openDraft, restoreDraft } from "../draft/draft";
import { knownRobots, listRobots } from "../draft/save-and-start";
import { resetSelection } from "../draft/selection";
import { chosen, reading, takeFiles } from "./dropped-files";

function startEmpty(): void {
  const description = empty();
  insertJoint(description, 0);
  resetSelection();
  openDraft({ description, files: {} });
}

export function NewRobot() {
  useEffect(() => void listRobots(), []);
  const robots = knownRobots.value?.robots;
  return (
    <div class="start grid wide gap-16">
      <div class="start-head grid gap-8">
        <h1>{d("start_title")}</h1>
        <p class="dim">{d("start_words")}</p>
        {newDrafts().map(({ id, name, at }) => (
          <p key={id} class="row wrap gap-8-16">
            <Button text={d("continue_draft", { name, time: whenText(at) })} onClick={() => restoreDraft("", id)} />
          </p>
        ))}
      </div>
      <section class="panel start-drop" aria-label={d("start_files")}>
        <DropMark />
        <div>
          <h2>{d("start_files")}</h2>
          <p class="dim">{d("start_files_words")}</p>
        </div>
        <FileButton label={d("choose_files")} multiple take={(files) => void takeFiles(chosen(files))} />
        {reading.value && <p role="status">{reading.value}</p>}
      </section>
      <div class="start-more grid gap-16">
        <section class="panel" aria-label={d("start_urdf")}>
          <h2>{d("start_urdf")}</h2>
          <p class="dim">{d("start_urdf_words")}</p>
          <FileButton label={d("choose_files")} multiple take={(files) => void takeFiles(chosen(files), true)} />
        </section>
        <section class="panel" aria-label={d("start_empty")}>
          <h2>{d("start_empty")}</h2>
          <p class="dim">{d("start_empty_words")}</p>
          <Button text={d("start_empty_button")} onClick={startEmpty} />
        </section>
      </div>
      <section class="grid gap-8" aria-label={d("start_robot")}>
        <h2>{d("start_robot")}</h2>
        {robots?.length === 0 && <p class="dim">{d("start_none")}</p>}
        <ul class="robot-cards grid gap-8">
          {(robots ?? []).map(({ name, title, origin, joints, running }) => (
            <li key={name}>
              <a class="robot-card grid card pad-8-16" href={`#/define/${encodeURIComponent(name)}`}>
                <strong>{title || name}</strong>
                <span class="dim small">
                  {[
                    d(`origin_${origin}`),
                    joints === 1 ? d("joint_one") : d("joints_count", { count: joints }),
                    ...(running ? [d("running")] : []),
                    ...(hasStoredDraft(name) ? [d("unsaved_draft")] : []),
                  ].join(" · ")}
                </span>
              </a>
            </li>
          ))}
        </ul>
      </section>
    </div>
  );
}

function DropMark() {
  return (
    <svg class="drop-mark" viewBox="0 0 48 48" width="48" height="48" aria-hidden="true">
      <path d="M8 42h22M15 42V27l14-13 12 8" />
      <circle cx="15" cy="27" r="4" />
      <circle cx="29" cy="14" r="4" />
    </svg>
  );
}
