// The last speed that any operator set through the gateway, and the speed to request.

import { useRef, useState } from "preact/hooks";
import { fixed } from "../../i18n/format";
import { t } from "../../i18n/texts";

const LOW_PERCENT = 10;
const PUBLICATION_DELAY_MS = 500; // the new speed is published just after the answer

/** A slider that sends on release or Enter; until then its value is marked as not sent. */
export function Speed(props: {
  /** Undefined: not set since the link was established. */
  percent: number | undefined;
  enabled: boolean;
  send: (percent: number) => Promise<boolean>;
}) {
  const { enabled } = props;
  const [unsent, setUnsent] = useState<number | null>(null);
  const [sent, setSent] = useState<number | null>(null);
  const dragging = useRef(false);
  const percent = unsent ?? sent ?? props.percent;
  const text = percent === undefined ? t("speed_unset") : `${fixed(percent, 0)}\u202f%`;
  const takeBack = () => {
    dragging.current = false;
    setUnsent(null);
  };
  const release = () => {
    takeBack();
    if (unsent === null || !enabled) return;
    setSent(unsent);
    void props.send(unsent).finally(() => setTimeout(() => setSent(null), PUBLICATION_DELAY_MS));
  };
  const low = percent !== undefined && percent < LOW_PERCENT;
  const hint =
    unsent !== null
      ? t(dragging.current ? "let_go_sends" : "enter_sends", { value: text })
      : percent === undefined
        ? t("speed_unset_hint")
        : low
          ? t("speed_low")
          : "\u00a0";
  return (
    <div class={`speed ${percent === undefined ? "unset" : unsent !== null ? "unsent" : low ? "low" : ""}`}>
      <label class="row gap-12">
        <span class="dim">{t("speed")}</span>
        <input
          type="range"
          min={1}
          max={100}
          step={1}
          value={percent ?? 100}
          disabled={!enabled}
          title={t("speed_hint")}
          aria-valuetext={text}
          onInput={(event) => setUnsent(Number(event.currentTarget.value))}
          onPointerDown={() => (dragging.current = true)}
          onPointerUp={release}
          onPointerCancel={takeBack}
          onBlur={takeBack}
          onKeyDown={(event) => {
            if (event.key === "Enter") release();
            else if (event.key === "Escape") takeBack();
          }}
        />
        <span class="value">{text}</span>
      </label>
      <p class="speed-hint" role="status">
        {low && unsent === null && <span class="shape warning" aria-hidden="true" />}
        {hint}
      </p>
    </div>
  );
}
