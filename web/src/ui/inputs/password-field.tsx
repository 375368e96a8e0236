// A password field that can show its text and warns of Caps Lock.

import { useId, useState } from "preact/hooks";
import { accountText as a } from "../../i18n/texts";
import { Button } from "./button";
import "./password-field.css";

export function PasswordField(props: {
  label: string;
  kind: "current-password" | "new-password";
  value: string;
  set: (value: string) => void;
  hint?: string;
}) {
  const id = useId();
  const [shown, setShown] = useState(false);
  const [caps, setCaps] = useState(false);
  const updateCaps = (event: KeyboardEvent) => setCaps(event.getModifierState?.("CapsLock") ?? false);
  return (
    <div class="field">
      <label for={id}>
        <span>{props.label}</span>
      </label>
      <span class="password-field">
        <input
          {...(shown ? ({ type: "text" } as const) : ({ type: "password" } as const))}
          id={id}
          name={props.kind}
          autocomplete={props.kind}
          autocapitalize="none"
          autocorrect="off"
          spellcheck={false}
          maxLength={256}
          required
          value={props.value}
          onInput={(event) => props.set(event.currentTarget.value)}
          onKeyDown={updateCaps}
          onKeyUp={updateCaps}
        />
        <Button
          quiet
          text={a(shown ? "hide" : "show")}
          type="button"
          aria-pressed={shown}
          onClick={() => setShown(!shown)}
        />
      </span>
      {caps && (
        <span class="state warning" role="status">
          {a("caps")}
        </span>
      )}
      {props.hint && <span class="dim">{props.hint}</span>}
    </div>
  );
}
