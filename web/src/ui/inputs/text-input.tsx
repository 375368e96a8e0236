// A field for one line of text.

import type { InputHTMLAttributes } from "preact";

/** A field that the browser neither completes nor corrects, unless `attributes` say so.
 *
 * @param props.hint Its name, which it also shows while it is empty. */
export function TextInput(
  props: InputHTMLAttributes<HTMLInputElement> & {
    type?: "text" | "search" | "password";
    value: string;
    set: (text: string) => void;
    hint?: string;
  },
) {
  const { set, hint, ...attributes } = props;
  return (
    <input
      type="text"
      autocomplete="off"
      spellcheck={false}
      {...(hint && { placeholder: hint, "aria-label": hint })}
      {...attributes}
      onInput={(event) => set(event.currentTarget.value)}
    />
  );
}
