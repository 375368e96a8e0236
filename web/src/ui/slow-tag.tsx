// The mark of a robot with too few positions a second to follow its arm.

import type { ControllerState } from "../gen/robomesh_pb";
import { fixed } from "../i18n/format";
import { t } from "../i18n/texts";
import { Tag } from "./tag";

/** Nothing if there are enough positions. */
export function SlowTag({ state }: { state: ControllerState | undefined }) {
  const slow = state?.capabilities?.slowHz;
  if (slow === undefined) return null;
  const rate = fixed(slow, Number.isInteger(slow) ? 0 : 1);
  return (
    <span title={t("slow_hint", { rate })}>
      <Tag kind="slow">{t("slow", { rate })}</Tag>
    </span>
  );
}
