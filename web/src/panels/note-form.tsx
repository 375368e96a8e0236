// A form for a note on a robot's time.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { notesText as n, t } from "../i18n/texts";
import { mayAct } from "../mesh/console/account";
import { hello, reasonOf } from "../mesh/console/connection";
import type { Notice } from "../mesh/control/control";
import { operator, setOperator } from "../mesh/control/control";
import { asker } from "../mesh/services/alarms";
import type { NoteTime } from "../mesh/services/notes";
import { LONGEST_TEXT, writeNote } from "../mesh/services/notes";
import { Button } from "../ui/button";
import { NoticeLine } from "../ui/notice-line";
import { TextInput } from "../ui/text-input";
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
  const [notice, setNotice] = useState<Notice | null>(null);
  const input = useRef<HTMLInputElement>(null);
  useEffect(() => input.current?.focus(), []);
  const busy = notice?.kind === "busy";
  const cannot = !mayAct.value ? n("monitor") : !asker.value ? n("name_needed") : "";
  const save = async () => {
    setNotice({ kind: "busy", text: n("saving") });
    try {
      await writeNote(props.robotKey, text.trim(), props.on());
      props.close();
    } catch (error) {
      setNotice({ kind: "refused", text: n("not_saved", { text: reasonOf(error) }) });
    }
  };
  return (
    <form
      class="note-form grid gap-8 pad-8-16"
      aria-label={n("note")}
      onKeyDown={(event) => event.key === "Escape" && props.close()}
      onSubmit={(event) => {
        event.preventDefault();
        if (!busy && !cannot && text.trim()) void save();
      }}
    >
      <TextInput
        ref={input}
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
        <Button primary text={n("save")} type="submit" disabled={busy || cannot !== "" || !text.trim()} />
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
