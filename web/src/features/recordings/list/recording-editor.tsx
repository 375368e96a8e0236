// A form for a recording's name, note and tags, and for its deletion.

import { useState } from "preact/hooks";
import { recordingsText as r } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { ReasonForm } from "../../../ui/inputs/reason-form";
import { submit } from "../../../ui/inputs/submit";
import { TextInput } from "../../../ui/inputs/text-input";
import { NoticeLine } from "../../../ui/panel/notice-line";
import { useOutcome } from "../../../ui/panel/outcome";
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
  const { notice, isBusy, perform } = useOutcome((text) => r("not_changed", { text }));
  const [deleting, setDeleting] = useState(false);
  const title = seen.recording.name || seen.recording.file;
  const attempt = (work: () => Promise<void>) =>
    void perform("", async () => {
      await work();
      close();
      return undefined;
    });
  const save = () => {
    const list = tags
      .split(/[,，]/)
      .map((each) => each.trim())
      .filter(Boolean);
    attempt(() => saveLabels(seen, { name: name.trim(), note: note.trim(), tags: list }));
  };
  return (
    <div class="recording-editor whole-row ruled">
      <form
        aria-label={r("edit_of", { name: title })}
        onKeyDown={(event) => event.key === "Escape" && close()}
        onSubmit={submit(save)}
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
          <Button primary text={r("save")} type="submit" disabled={isBusy || !name.trim()} />
          <Button text={r("cancel")} type="button" disabled={isBusy} onClick={close} />
          {!seen.recording.open && (
            <button type="button" class="action push" disabled={isBusy} onClick={() => setDeleting(true)}>
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
          done={(reason) => attempt(() => deleteRecording(seen, reason))}
        />
      )}
      {notice && <NoticeLine notice={notice} />}
    </div>
  );
}
