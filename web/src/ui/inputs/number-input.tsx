// A field for a number, in the unit that it shows.

import { useState } from "preact/hooks";
import { numberText, readNumber } from "./number-text";
import { TextInput } from "./text-input";

const SAME = 1e-9; // numbers that differ less were converted to another unit and back

/** Arrow keys step the number; invalid text stays, marked, until it is corrected or given up by Escape. */
export function NumberInput(
  props: Partial<Record<"title" | "data-path" | "aria-describedby", string | undefined>> & {
    id: string;
    disabled?: boolean;
    "aria-invalid"?: boolean;
    onFocus?: () => void;
    value: number;
    set: (value: number) => void;
    step?: number;
    positive?: boolean;
    format?: (value: number) => string;
    /** The invalid text, where it outlives the field. */
    invalid?: string | undefined;
    setInvalid?: (text: string | null) => void;
    /** Typing and stepping ended. */
    end?: () => void;
  },
) {
  const { value, set, step = 1, positive, format = numberText, invalid, setInvalid, end, ...attributes } = props;
  const [typing, setTyping] = useState<string | null>(null);
  const read = (text: string) => {
    const number = readNumber(text);
    return number !== null && positive && number <= 0 ? null : number;
  };
  const type = (text: string | null) => {
    setTyping(text);
    setInvalid?.(text !== null && read(text) === null ? text : null);
  };
  const typed = invalid ?? typing;
  const number = typed === null ? value : read(typed);
  // Keep the typed text while it has the value; an undo shows the value again.
  const isKept = typed !== null && (number === null || Math.abs(number - value) < SAME);
  const onKey = (event: KeyboardEvent) => {
    const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (direction) {
      event.preventDefault();
      type(null);
      const stepped = Math.round((value + step * (event.shiftKey ? 10 : 1) * direction) * 1e6) / 1e6;
      if (!positive || stepped > 0) set(stepped);
    } else if (event.key === "Escape" || (event.key === "Enter" && number !== null)) {
      type(null);
      end?.();
    }
  };
  return (
    <TextInput
      inputMode="decimal"
      aria-invalid={number === null}
      {...attributes}
      value={isKept ? typed : format(value)}
      set={(text) => {
        const now = read(text);
        type(text);
        if (now !== null) set(now);
      }}
      onBlur={() => {
        if (number !== null) type(null);
        end?.();
      }}
      onKeyDown={onKey}
    />
  );
}
