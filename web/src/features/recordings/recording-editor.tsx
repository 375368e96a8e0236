// A form for a recording's name, note and tags, and for its deletion.

import { useState } from "preact/hooks";
import { recordingsText as r } from "../../i18n/texts";
import { reasonOf } from "../../mesh/console/connection";
import { Button } from "../../ui/button";
import { NoticeLine } from "../../ui/notice-line";
import { ReasonForm } from "../../ui/reason-form";
import { TextInput } from "../../ui/text-input";
import { deleteRecording, saveLabels } from "./recording-changes";
import type { Row } from "./recordings-of-sites";

const LONGEST_NAME = 60;
const LONGEST_NOTE = 2000;

export function RecordingEditor({ row, close }: { row: Row; close: () => void }) {
  // The form changes what its author saw, also if a colleague is faster: the recorder refuses that.
  const [seen] = useState(row);
  const [name, setName] = useState(seen.recording.name);
  const [note, setNote] = useState(seen.recording.note);
  const [tags, setTags] = useState(seen.recording.tags.join(", "));
  const [busy, setBusy] = useState(false);
  const [problem, setProblem] = useState("");
  const [deleting, setDeleting] = useState(false);
  const title = seen.recording.name || seen.recording.file;
  const attempt = async (work: Promise<void>) => {
    setBusy(true);
    setProblem("");
    try {
      await work;
      close();
    } catch (error) {
      setProblem(r("not_changed", { text: reasonOf(error) }));
    }
    setBusy(false);
  };
  const save = () => {
    const list = tags
      .split(/[,，]/)
      .map((each) => each.trim())
      .filter(Boolean);
    void attempt(saveLabels(seen, { name: name.trim(), note: note.trim(), tags: list }));
  };
  return (
    <div class="recording-editor whole-row ruled">
      <form
        aria-label={r("edit_of", { name: title })}
        onKeyDown={(event) => event.key === "Escape" && close()}
        onSubmit={(event) => {
          event.preventDefault();
          save();
        }}
      >
        <label>
          <span class="dim small">{r("name")}</span>
          <TextInput value={name} maxLength={LONGEST_NAME} set={setName} />
        </label>
        <label>
          <span class="dim small">{r("tags_hint")}</span>
          <TextInput value={tags} set={setTags} />
        </label>
        <label class="whole-row">
          <span class="dim small">{r("note")}</span>
          <textarea
            rows={3}
            value={note}
            maxLength={LONGEST_NOTE}
            onInput={(event) => setNote(event.currentTarget.value)}
          />
        </label>
        <div class="whole-row flex wrap gap-8">
          <Button primary text={r("save")} type="submit" disabled={busy || !name.trim()} />
          <Button text={r("cancel")} type="button" disabled={busy} onClick={close} />
          {!seen.recording.open && (
            <button type="button" class="action push" disabled={busy} onClick={() => setDeleting(true)}>
              {r("delete")}
            </button>
          )}
        </div>
      </form>
      {deleting && (
        <ReasonForm
          title={r("delete_of", { name: title })}
          text={r("delete_words", { name: title })}
          does={r("delete_now")}
          required
          close={() => setDeleting(false)}
          done={(reason) => void attempt(deleteRecording(seen, reason))}
        />
      )}
      {problem && <NoticeLine notice={{ kind: "refused", text: problem }} />}
    </div>
  );
}
