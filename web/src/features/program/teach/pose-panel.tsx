// The ghost's tool pose as numbers; the gizmo in the 3-D view sets the same pose.

import { useEffect, useState } from "preact/hooks";
import { DASH, fixed } from "../../../i18n/format";
import { programText as p } from "../../../i18n/texts";
import { Choice } from "../../../ui/inputs/choice";
import { TextInput } from "../../../ui/inputs/text-input";
import { dropRequestedPose, poseNumbers, poseOf, taughtPose, teachPose } from "../motion/taught-pose";
import { gizmoMode } from "./teach-gizmo";

const GIZMO = ["translate", "rotate"] as const;
const AXES = ["x", "y", "z"] as const;
const ANGLES = ["roll", "pitch", "yaw"] as const;

export function PosePanel() {
  const pose = taughtPose.value;
  const numbers = pose ? poseNumbers(pose) : [];
  useEffect(() => {
    gizmoMode.value = "translate";
    return () => {
      gizmoMode.value = "off";
      dropRequestedPose();
    };
  }, []);
  const set = (index: number, value: number) =>
    pose && teachPose(poseOf(numbers.map((each, i) => (i === index ? value : each))));
  return (
    <>
      <div class="gizmo-row row spread gap-8">
        <span class="dim small">{p("gizmo")}</span>
        <Choice
          label={p("gizmo")}
          values={GIZMO}
          chosen={gizmoMode.value === "rotate" ? "rotate" : "translate"}
          text={(each) => p(`gizmo_${each}`)}
          choose={(each) => (gizmoMode.value = each)}
        />
      </div>
      <div class="pose-fields grid gap-8">
        {[...AXES, ...ANGLES].map((name, index) => (
          <PoseField
            key={name}
            label={p(name)}
            unit={index < 3 ? "mm" : "°"}
            decimals={index < 3 ? 1 : 2}
            value={numbers[index]}
            set={(value) => set(index, value)}
          />
        ))}
      </div>
    </>
  );
}

function PoseField(props: {
  label: string;
  unit: string;
  decimals: number;
  value: number | undefined;
  set: (value: number) => void;
}) {
  const [typed, setTyped] = useState<string | null>(null);
  const { value } = props;
  const shown = typed ?? (value === undefined ? DASH : fixed(value, props.decimals));
  const enter = (text: string) => {
    setTyped(null);
    const number = Number(text.trim().replace("−", "-").replace(",", "."));
    if (text.trim() && Number.isFinite(number)) props.set(number);
  };
  const onKey = (event: KeyboardEvent & { currentTarget: HTMLInputElement }) => {
    const by = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (by !== undefined && value !== undefined) {
      event.preventDefault();
      setTyped(null);
      props.set(value + by * (event.shiftKey ? 0.1 : 1));
    } else if (event.key === "Enter") enter(event.currentTarget.value);
    else if (event.key === "Escape") setTyped(null);
  };
  return (
    <label class="pose-field">
      <span class="dim small">
        {props.label} [{props.unit}]
      </span>
      <TextInput
        inputMode="decimal"
        maxLength={12}
        title={p("pose_keys")}
        value={shown}
        set={setTyped}
        onBlur={(event) => typed !== null && enter(event.currentTarget.value)}
        onKeyDown={onKey}
      />
    </label>
  );
}
