// A form for a note on a robot's time.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { notesText as n, t } from "../i18n/texts";
import { mayAct } from "../mesh/console/account";
import { hello } from "../mesh/console/connection";
import { operator, setOperator } from "../mesh/control/control";
import { asker } from "../mesh/services/alarms";
import type { NoteTime } from "../mesh/services/notes";
import { LONGEST_TEXT, writeNote } from "../mesh/services/notes";
import { Button } from "../ui/inputs/button";
import { submit } from "../ui/inputs/submit";
import { TextInput } from "../ui/inputs/text-input";
import { NoticeLine } from "../ui/panel/notice-line";
import { useOutcome } from "../ui/panel/outcome";
import "./note-form.css";

export function NoteForm(props: {
  /** The recorded robot's key, not a replay's. */
  robotKey: string;
  /** Return the time that the note is on; null: the present. */
  on: () => NoteTime | null;
  /** A choice of that time. */
  children: ComponentChildren;
  close: () => void;
}) {
  const [text, setText] = useState("");
  const { notice, isBusy, perform } = useOutcome((text) => n("not_saved", { text }));
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => input.current?.focus(), []);
  const cannot = !mayAct.value ? n("monitor") : !asker.value ? n("name_needed") : "";
  const save = () =>
    perform(n("saving"), async () => {
      await writeNote(props.robotKey, text.trim(), props.on());
      props.close();
      return undefined;
    });
  return (
    <form
      class="note-form grid gap-8 pad-8-16"
      aria-label={n("note")}
      onKeyDown={(event) => event.key === "Escape" && props.close()}
      onSubmit={submit(() => !isBusy && !cannot && text.trim() && void save())}
    >
      <TextInput
        ref={input}
        spellcheck
        maxLength={LONGEST_TEXT}
        aria-label={n("text")}
        placeholder={n("note_hint")}
        value={text}
        set={setText}
      />
      {props.children}
      {!hello.value?.operator && (
        <TextInput
          name="operator"
          autocomplete="username"
          maxLength={40}
          hint={t("operator")}
          value={operator.value}
          set={setOperator}
        />
      )}
      <div class="note-row row wrap to-end gap-8">
        <NoticeLine notice={notice} idle={cannot} />
        <Button text={t("cancel")} type="button" onClick={props.close} />
        <Button primary text={n("save")} type="submit" disabled={isBusy || cannot !== "" || !text.trim()} />
      </div>
    </form>
  );
}

/** A text that was withdrawn is struck through, and says so. */
export function Withdrawable({ withdrawn, children }: { withdrawn: boolean; children: ComponentChildren }) {
  if (!withdrawn) return <>{children}</>;
  return (
    <>
      <del>{children}</del> <span class="dim">({n("withdrawn")})</span>
    </>
  );
}
