// A button that steps once a press, without repeat. Space does not press it: Space requests a stop.

import "./step-button.css";

export function StepButton(props: { name: string; sign: 1 | -1; enabled: boolean; press: (button: Element) => void }) {
  return (
    <button
      class="step"
      data-moves
      aria-label={props.name}
      title={props.name}
      disabled={!props.enabled}
      onClick={(event) => props.press(event.currentTarget)}
      onKeyDown={(event) => event.repeat && event.preventDefault()}
    >
      {props.sign > 0 ? "+" : "−"}
    </button>
  );
}
