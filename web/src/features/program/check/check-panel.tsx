// Result of the check: the verdict in words, its assumptions, and a row a violation.

import type { CheckAnswer } from "../../../gen/robomesh_pb";
import { whenText } from "../../../i18n/format";
import { reasonText } from "../../../i18n/reasons";
import { programText as p, t } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Warning } from "../../../ui/marks/warning";
import { Panel } from "../../../ui/panel/panel";
import { draft, goToLine } from "../draft/draft";
import { distanceText, seconds } from "../motion/number-format";
import { checkError, checked, checking, checkNow, errorsOf, isCurrent } from "../motion/program-check";
import { clickedViolation, showMoment } from "../motion/scene-overlay";
import type { ViolationGroup } from "../motion/violations";
import { groupViolations, kindText, severityOf } from "../motion/violations";
import "./check-panel.css";

export function CheckPanel({ moved }: { moved: boolean }) {
  const answer = checked.value?.answer;
  const violations = answer?.violations ?? [];
  return (
    <Panel
      name="check-panel"
      title={p("check")}
      end={<Button quiet text={p("check_again")} disabled={!draft.value?.text.trim()} onClick={checkNow} />}
    >
      <Verdict moved={moved} />
      {violations.length > 0 && (
        <ol class={`violations ${isCurrent() ? "" : "old"}`} aria-label={p("violations")}>
          {groupViolations(violations, checked.value?.text ?? "").map((group, index) => (
            <li key={index}>
              <Row group={group} />
            </li>
          ))}
        </ol>
      )}
      {answer && <Notes answer={answer} />}
    </Panel>
  );
}

function Verdict({ moved }: { moved: boolean }) {
  const answer = checked.value?.answer;
  const busy = checking.value || (checked.value !== null && !isCurrent());
  if (checkError.value && !checking.value) {
    return (
      <Warning
        class="verdict row wrap rigid tall-32 gap-0-8 pad-0-16-8 warned"
        role="alert"
        text={<span>{p("check_failed", { text: checkError.value })}</span>}
      />
    );
  }
  if (!answer || !checked.value) {
    const idle = draft.value?.text.trim() ? p("checking") : p("check_empty");
    return (
      <p class="verdict row wrap rigid tall-32 gap-0-8 pad-0-16-8 dim" role="status">
        {idle}
      </p>
    );
  }
  const errors = errorsOf(answer).length;
  const count = answer.violations.length;
  const refused = answer.violations.some((each) => each.refuses);
  const level = refused ? "alarm" : count || answer.alone ? "warning" : "normal";
  const duration = seconds(answer.durationS);
  const words = errors
    ? p(errors === 1 ? "verdict_error" : "verdict_errors", { count: errors })
    : refused
      ? p(count === 1 ? "verdict_one" : "verdict_many", { count, duration })
      : p(count ? "verdict_warns" : answer.alone ? "verdict_alone" : "verdict_ok", { count, duration });
  return (
    <p
      class={`verdict row wrap rigid tall-32 gap-0-8 pad-0-16-8 ${level} ${busy ? "busy" : ""}`}
      role="status"
      data-ok={!refused}
      aria-busy={busy}
    >
      <span class={`shape ${level}`} aria-hidden="true" />
      <strong>{words}</strong>
      <span class="dim small">
        {busy
          ? p("checking")
          : errors
            ? ""
            : moved
              ? p("moved_since")
              : p("checked_at", { time: whenText(checked.value.at) })}
      </span>
    </p>
  );
}

function Notes({ answer }: { answer: CheckAnswer }) {
  const notes = answer.notes.map((note, index) => reasonText(answer.noteReasons[index], note));
  const interpolation = reasonText(answer.interpolationReason, answer.interpolation);
  return (
    <>
      {notes.length > 0 && (
        <ul class="check-notes scroll small ruled pad-8-16" aria-label={p("notes")} tabIndex={0}>
          {notes.map((note) => (
            <li key={note}>{note}</li>
          ))}
        </ul>
      )}
      {interpolation && errorsOf(answer).length === 0 && (
        <details class="assumed small dim ruled">
          <summary>{p("assumed")}</summary>
          <p>{interpolation}</p>
        </details>
      )}
    </>
  );
}

function Row({ group: { worst, first, last, fromS, untilS } }: { group: ViolationGroup }) {
  const { line, timeS, kind, pair, text, distance } = worst;
  const current = clickedViolation.value === worst;
  const level = severityOf(worst);
  const known = kindText(kind);
  const isText = kind === "program";
  const show = () => {
    clickedViolation.value = worst;
    if (!isText) showMoment(timeS);
    if (line > 0) goToLine(line);
  };
  return (
    <button class="violation pick grid small tall-44 gap-0-8 pad-4-8" aria-current={current} onClick={show}>
      <span class={`toned row bold ${level}`}>
        <span class={`shape ${level}`} aria-hidden="true" />
        {known ? p(known) : kind}
      </span>
      <span class="right dim">
        {line > 0 && (first < last ? p("lines_to", { first, last }) : p("line", { line }))}
        {!isText &&
          ` · ${untilS > fromS + 0.05 ? p("from_to", { from: seconds(fromS), to: seconds(untilS) }) : seconds(fromS)}`}
        {distance !== undefined && pair.length > 0 && ` · ${distance > 0 ? distanceText(distance) : p("touch")}`}
      </span>
      <span class="whole-row break">{reasonText(worst.reason, text) || pair.join(" – ") || t("state_unknown")}</span>
    </button>
  );
}
