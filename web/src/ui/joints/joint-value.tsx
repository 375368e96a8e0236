// A joint's value; a press turns it into a field for an exact target: Enter sends, Escape cancels.

import { useState } from "preact/hooks";
import type { Description_Joint } from "../../gen/robomesh_pb";
import { DASH, fixed, jointTitle, jointUnit } from "../../i18n/format";
import { t } from "../../i18n/texts";
import { TextInput } from "../inputs/text-input";
import { Unit } from "../marks/unit";

export function JointValue(props: {
  joint: Description_Joint;
  position: number | undefined;
  stale: boolean;
  enabled: boolean;
  /** Called while a number within the limits is typed; undefined: cancelled. */
  preview: (value: number | undefined) => void;
  send: (value: number) => void;
  wrong: (text: string) => void;
}) {
  const { joint, position, enabled } = props;
  const { unit, decimals, factor } = jointUnit(joint);
  const [typed, setTyped] = useState<string | null>(null);
  const text = position === undefined ? DASH : fixed(position * factor, decimals);
  const end = () => {
    setTyped(null);
    props.preview(undefined);
  };
  const enter = () => {
    const value = numberOf(typed ?? "");
    end();
    if (Number.isFinite(value)) props.send(value / factor);
    else props.wrong(t("no_number", { text: typed ?? "" }));
  };
  const type = (text: string) => {
    setTyped(text);
    const value = numberOf(text) / factor;
    props.preview(value >= joint.lower && value <= joint.upper ? value : undefined);
  };
  return (
    <span class={`value ${props.stale ? "stale" : ""}`} data-joint={joint.name}>
      {!enabled ? (
        text
      ) : typed === null ? (
        <button
          class="value-button"
          title={t("type_target")}
          aria-label={`${t("joint_type", { joint: jointTitle(joint) })}: ${text}`}
          onClick={() => setTyped("")}
        >
          {text}
        </button>
      ) : (
        <TextInput
          class="value-field"
          inputMode="decimal"
          maxLength={12}
          placeholder={text}
          aria-label={t("joint_type", { joint: jointTitle(joint) })}
          title={t("type_target")}
          ref={focus}
          value={typed}
          set={type}
          onBlur={end}
          onKeyDown={(event) => {
            if (event.key === "Enter") enter();
            else if (event.key === "Escape") end();
          }}
        />
      )}
      <Unit of={unit} />
    </span>
  );
}

const focus = (field: HTMLInputElement | null) => field?.focus();

/** Parse a number with a comma or a true minus sign; NaN if it is invalid. */
function numberOf(text: string): number {
  const plain = text.trim().replace("−", "-").replace(",", ".");
  return plain ? Number(plain) : NaN;
}
