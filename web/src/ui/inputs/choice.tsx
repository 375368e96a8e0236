// Buttons that choose one of several values, or switch one thing on and off; in a form they do not submit it.

/** Buttons, one of which is chosen. */
export function Choice<Value extends string>(props: {
  label: string;
  values: readonly Value[];
  chosen: Value;
  text: (value: Value) => string;
  choose: (value: Value) => void;
}) {
  return (
    <div class="choice" role="group" aria-label={props.label}>
      {props.values.map((value) => (
        <button key={value} type="button" aria-pressed={value === props.chosen} onClick={() => props.choose(value)}>
          {props.text(value)}
        </button>
      ))}
    </div>
  );
}

export function Toggle(props: { text: string; on: boolean; set: (on: boolean) => void; label?: string }) {
  return (
    <button
      type="button"
      class="toggle"
      aria-pressed={props.on}
      aria-label={props.label}
      onClick={() => props.set(!props.on)}
    >
      {props.text}
    </button>
  );
}
