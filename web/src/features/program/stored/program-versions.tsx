// Versions of one stored program: who made each and when, and how two of them differ.

import { useState } from "preact/hooks";
import type { ProgramContent, ProgramVersion } from "../../../gen/robomesh_pb";
import { ProgramVersion_Change as Change } from "../../../gen/robomesh_pb";
import { storedText as s, t } from "../../../i18n/texts";
import { mayAct } from "../../../mesh/console/account";
import { Button } from "../../../ui/inputs/button";
import { ReasonForm } from "../../../ui/inputs/reason-form";
import { submit } from "../../../ui/inputs/submit";
import { TextInput } from "../../../ui/inputs/text-input";
import { download, draft } from "../draft/draft";
import { Difference } from "./difference";
import { isDeleted, open, remove, rename, restore, shown, showVersion, timeOf } from "./stored-programs";

export function Versions(props: {
  robotKey: string;
  content: ProgramContent;
  against: number | null;
  old: ProgramContent | null;
}) {
  const { robotKey, content, against, old } = props;
  const [form, setForm] = useState<"" | "rename" | "delete">("");
  const [name, setName] = useState("");
  const { program, version } = content;
  if (!program || !version) return null;
  const title = program.current?.name ?? "";
  const isCurrent = version.number === program.current?.number;
  const numbers = content.versions.map((each) => each.number).filter((each) => each !== version.number);
  // The draft is what an operator is about to save, so it is the new side.
  const [oldText, newText] = old ? [old.text, content.text] : [content.text, draft.value?.text ?? ""];
  return (
    <>
      <div class="stored-tools">
        <h3>{title}</h3>
        <Button
          text={s("rename")}
          disabled={!mayAct.value || isDeleted(program)}
          onClick={() => (setName(title), setForm(form === "rename" ? "" : "rename"))}
        />
        <Button
          text={s("delete")}
          disabled={!mayAct.value || isDeleted(program)}
          onClick={() => setForm(form === "delete" ? "" : "delete")}
        />
        <Button text={s("export")} onClick={() => download(content.text, title)} />
      </div>
      {form === "rename" && (
        <form
          class="stored-rename flex wrap gap-8"
          onSubmit={submit(() => {
            setForm("");
            void rename(robotKey, program, name);
          })}
        >
          <TextInput maxLength={60} aria-label={s("new_name")} value={name} set={setName} />
          <Button text={t("cancel")} type="button" onClick={() => setForm("")} />
          <Button primary text={s("rename")} type="submit" disabled={!name.trim() || name === title} />
        </form>
      )}
      {form === "delete" && (
        <ReasonForm
          title={s("delete_of", { name: title })}
          text={s("delete_words")}
          does={s("delete")}
          required
          close={() => setForm("")}
          done={(reason) => void remove(robotKey, program, reason)}
        />
      )}
      <ol class="versions" reversed aria-label={s("versions_of", { name: title })}>
        {content.versions.toReversed().map((each) => (
          <li key={each.number}>
            <button
              class="version grid baseline wide break left tall-32 gap-8 pad-4-8"
              aria-current={each.number === version.number}
              onClick={() => void showVersion(robotKey, program.id, each.number)}
            >
              <span class="version-number">{each.number}</span>
              <span>
                {changeText(each)}
                {each.number === program.current?.number && <strong> · {s("current")}</strong>}
              </span>
              <span class="dim small">
                {each.author} · {timeOf(each)}
              </span>
            </button>
          </li>
        ))}
      </ol>
      <div class="stored-tools">
        <label class="compare row gap-8">
          <span class="dim small">{s("compare_with")}</span>
          <select
            value={against ?? "draft"}
            onChange={(event) => {
              const chosen = event.currentTarget.value;
              void showVersion(robotKey, program.id, version.number, chosen === "draft" ? null : Number(chosen));
            }}
          >
            <option value="draft">{s("this_draft")}</option>
            {(numbers.includes(against ?? 0) || against === null ? numbers : [...numbers, against]).map((each) => (
              <option key={each} value={each}>
                {s("version", { version: each })}
              </option>
            ))}
          </select>
        </label>
        <Button text={s("open_version")} onClick={() => open(content)} />
        <Button
          text={s("restore", { version: version.number })}
          disabled={!mayAct.value || (isCurrent && !isDeleted(program))}
          onClick={() => void restore(robotKey, content)}
        />
      </div>
      <Difference
        key={`${version.number} ${against}`}
        oldText={oldText}
        newText={newText}
        whole={oldText === newText ? content.text : null}
      />
    </>
  );
}

/** Two people's texts on one version: the author of the second decides, and both are kept. */
export function Conflict(props: { robotKey: string; mine: ProgramContent; theirs: ProgramContent }) {
  const { robotKey, mine, theirs } = props;
  const current = theirs.version;
  if (!current || !mine.version || !theirs.program) return null;
  const { id } = theirs.program;
  const values = { author: current.author, version: current.number, mine: mine.version.number, name: current.name };
  const useMine = async () => {
    await restore(robotKey, mine);
    if (draft.value?.base?.id === id) shown.value = null;
  };
  return (
    <>
      <p role="alert">
        <span class="shape warning" aria-hidden="true" /> <strong>{s("conflict", values)}</strong>
      </p>
      <p>{s("conflict_words", values)}</p>
      <div class="stored-tools">
        <Button text={s("use_theirs")} onClick={() => open(theirs)} />
        <Button primary text={s("use_mine")} onClick={() => void useMine()} />
      </div>
      <Difference oldText={theirs.text} newText={mine.text} whole={null} />
    </>
  );
}

/** A text that ran without being saved. */
export function RunText({ content }: { content: ProgramContent }) {
  const { version, text } = content;
  const name = version?.name ?? "";
  return (
    <>
      <div class="stored-tools">
        <h3>{s("ran", { name })}</h3>
        <Button text={s("export")} onClick={() => download(text, name)} />
        <Button text={s("open_version")} onClick={() => open(content)} />
      </div>
      <p class="dim">{s("ran_by", { author: version?.author ?? "", time: timeOf(version) })}</p>
      <Difference oldText={text} newText={text} whole={text} />
    </>
  );
}

function changeText({ change, name, basedOn, reason }: ProgramVersion): string {
  const known = change >= Change.SAVED && change <= Change.RUN;
  if (!known) return [String(change), name, reason].filter(Boolean).join(" ");
  const key = `change_${change}` as `change_${1 | 2 | 3 | 4 | 5 | 6}`;
  return s(key, { name, based_on: basedOn, reason });
}
