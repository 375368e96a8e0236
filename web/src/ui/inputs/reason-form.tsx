// A form for the reason of an action. Not a modal dialog: STOP stays within reach.

import type { ComponentChildren } from "preact";
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { t } from "../../i18n/texts";
import { Button } from "./button";
import { submit } from "./submit";
import { TextInput } from "./text-input";

export function ReasonForm(props: {
  title: string;
  text: string;
  does: string;
  required?: boolean;
  /** Something else is missing. */
  incomplete?: boolean;
  /** Other choices, between the text and the reason. */
  children?: ComponentChildren;
  close: () => void;
  done: (reason: string) => void;
}) {
  const [reason, setReason] = useState("");
  const form = useRef<HTMLFormElement>(null);
  const input = useRef<HTMLInputElement>(null);
  const opener = useRef(document.activeElement);
  useLayoutEffect(() => {
    // The first input, if there is more than the reason: the form must not scroll past it.
    (props.incomplete === undefined ? input.current : form.current?.querySelector("input"))?.focus();
    return () => opener.current instanceof HTMLElement && opener.current.focus();
  }, []);
  const missing = props.incomplete === true || (props.required === true && !reason.trim());
  return (
    <form
      ref={form}
      class="reason"
      aria-label={props.title}
      onKeyDown={(event) => event.key === "Escape" && props.close()}
      onSubmit={submit(() => {
        if (missing) return;
        props.close();
        props.done(reason.trim());
      })}
    >
      <p>{props.text}</p>
      {props.children}
      <label>
        <span class="dim">{t(props.required ? "reason_required" : "reason_optional")}</span>
        <TextInput ref={input} spellcheck maxLength={120} value={reason} set={setReason} />
      </label>
      <div class="reason-row flex to-end gap-8">
        <Button text={t("cancel")} type="button" onClick={props.close} />
        <Button primary text={props.does} type="submit" disabled={missing} />
      </div>
    </form>
  );
}
