// The programs that the site stores, in place of the text: their list, their versions, and differences.

import { useState } from "preact/hooks";
import { programText as p, storedText as s, t } from "../../../i18n/texts";
import { mayAct } from "../../../mesh/console/account";
import { Button } from "../../../ui/inputs/button";
import { Toggle } from "../../../ui/inputs/choice";
import { FileButton } from "../../../ui/inputs/file-button";
import { Panel } from "../../../ui/panel/panel";
import { draft, FILE_ENDING, isUnsaved } from "../draft/draft";
import { readProgramFile } from "../draft/program-files";
import { example } from "../draft/program-text";
import { description } from "../motion/program-robot";
import { Conflict, RunText, Versions } from "./program-versions";
import { attempt, importText, isDeleted, open, read, say, shown, showVersion, stored, timeOf } from "./stored-programs";
import "./stored-panel.css";

export function StoredPanel({ robotKey }: { robotKey: string }) {
  const now = shown.value;
  const back = () => {
    shown.value = null;
  };
  return (
    <Panel
      name="stored-panel"
      title={s("programs")}
      end={
        <>
          {now && now.kind !== "list" && (
            <Button quiet text={s("to_list")} onClick={() => (shown.value = { kind: "list" })} />
          )}
          <Button quiet text={s("back_to_text")} onClick={back} />
        </>
      }
    >
      <div class="stored-body stack grow short scroll ruled gap-8 pad-8">
        {now?.kind === "list" && <List robotKey={robotKey} />}
        {now?.kind === "program" && <Versions key={now.content.program?.id} robotKey={robotKey} {...now} />}
        {now?.kind === "conflict" && <Conflict robotKey={robotKey} {...now} />}
        {now?.kind === "run" && <RunText content={now.content} />}
        {now?.kind === "loading" && <p class="dim">{s("loading")}</p>}
      </div>
    </Panel>
  );
}

function List({ robotKey }: { robotKey: string }) {
  const [deletedToo, setDeletedToo] = useState(false);
  const [asking, setAsking] = useState("");
  const programs = (stored.value?.programs ?? []).filter((each) => deletedToo || !isDeleted(each));
  const openProgram = (id: string) => void attempt(async () => open(await read(robotKey, { id })));
  const importFiles = async (files: readonly File[]) => {
    for (const file of files) {
      const found = await readProgramFile(file);
      if ("problem" in found) say(() => s("not_imported", { name: file.name, text: s(found.problem) }), true);
      else await importText(robotKey, found.name, found.text);
    }
  };
  return (
    <>
      <div class="stored-tools">
        <Toggle text={s("show_deleted")} on={deletedToo} set={setDeletedToo} />
        <FileButton
          label={s("import")}
          disabled={!mayAct.value || !stored.value}
          multiple
          accept={`${FILE_ENDING},.txt,text/plain`}
          take={(files) => void importFiles(files)}
        />
      </div>
      {programs.length === 0 && <p class="dim">{s(stored.value ? "none" : "no_store")}</p>}
      <ul class="stored-list" aria-label={s("programs")}>
        {programs.map((program) => {
          const { id, current } = program;
          const name = current?.name ?? "";
          const [version, author] = [current?.number ?? 0, current?.author ?? ""];
          return (
            <li key={id} aria-current={draft.value?.base?.id === id}>
              <span class="stored-name grid narrow break">
                <strong>{name}</strong>
                <span class="dim small">
                  {isDeleted(program) && `${s("deleted")} · `}
                  {s("row", { version, author, time: timeOf(current) })}
                </span>
              </span>
              <Button
                text={s("versions")}
                aria-label={s("versions_of", { name })}
                onClick={() => showVersion(robotKey, id)}
              />
              <Button
                text={s("open")}
                aria-label={s("open_named", { name })}
                disabled={isDeleted(program)}
                onClick={() => (losesText() ? setAsking(id) : openProgram(id))}
              />
              {asking === id && (
                <p class="stored-ask row wrap gap-8" role="alert">
                  <span>{s("loses", { name: draft.value?.name ?? "" })}</span>
                  <Button text={t("cancel")} onClick={() => setAsking("")} />
                  <Button primary text={s("open_anyway")} onClick={() => openProgram(id)} />
                </p>
              )}
            </li>
          );
        })}
      </ul>
    </>
  );
}

/** Whether the draft is the operator's own work that no version has; the example for beginners is not. */
function losesText(): boolean {
  const robot = description.value;
  return isUnsaved.value && !(robot && draft.value?.text === example(robot, p("example_comment")));
}
