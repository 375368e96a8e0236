// Marks of a robot that is only watched, or has too few positions a second to follow its arm.

import type { ControllerState } from "../../gen/robomesh_pb";
import { fixed } from "../../i18n/format";
import { t } from "../../i18n/texts";
import { Tag } from "./tag";

/** Nothing for a robot that can be moved and followed. */
export function RobotTags({ state }: { state: ControllerState | undefined }) {
  const slow = state?.capabilities?.slowHz;
  const rate = slow === undefined ? "" : fixed(slow, Number.isInteger(slow) ? 0 : 1);
  return (
    <>
      {state?.readOnly && <Tag kind="read-only">{t("read_only")}</Tag>}
      {rate && (
        <span title={t("slow_hint", { rate })}>
          <Tag kind="slow">{t("slow", { rate })}</Tag>
        </span>
      )}
    </>
  );
}
