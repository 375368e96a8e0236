// Running the program: started by the operator in control, visible to all.

import { useState } from "preact/hooks";
import type { ControllerState, ProgramState } from "../../gen/robomesh_pb";
import { ProgramState_Outcome as Outcome } from "../../gen/robomesh_pb";
import { clock, stampWhen } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import { programText as p, t } from "../../i18n/texts";
import { reachable } from "../../mesh/console/connection";
import { Command, command } from "../../mesh/control/command";
import type { Notice } from "../../mesh/control/control";
import { holds } from "../../mesh/control/control";
import { whyFrozen } from "../../mesh/control/display-freshness";
import { whyNoNewMotion } from "../../mesh/state/robot-state";
import { now } from "../../mesh/state/topics";
import { NoticeLine } from "../../ui/panel/notice-line";
import { Panel } from "../../ui/panel/panel";
import type { Draft } from "./draft/draft";
import { draft } from "./draft/draft";
import { checked, errorsOf, isCurrent } from "./motion/program-check";
import { program } from "./motion/running-program";
import { hideMoment } from "./motion/scene-overlay";
import "./run-panel.css";

export function RunPanel(props: { robotKey: string; controller: ControllerState | undefined }) {
  const { robotKey } = props;
  const [shownNotice, setShownNotice] = useState<{ notice: Notice; of: Draft | null } | null>(null);
  // A run of another text or name does not apply.
  const notice =
    shownNotice && (shownNotice.notice.kind === "busy" || shownNotice.of === draft.value) ? shownNotice.notice : null;
  const state = program.value;
  const running = state?.outcome === Outcome.RUNNING;
  const why = whyNotRun(robotKey, props.controller, running);
  const name = draft.value?.name.trim() || p("default_name");
  const run = () => {
    hideMoment(); // the ghost would hide the robot
    const of = draft.value;
    const values = { program: of?.text ?? "", programName: name };
    void command(robotKey, Command.RUN_PROGRAM, name, values, (notice) => {
      // Once it runs, its progress is shown instead.
      if (notice.kind === "done" && !notice.warning) setShownNotice(null);
      else setShownNotice({ notice: notice.kind === "busy" ? { ...notice, text: p("asking_run") } : notice, of });
    });
  };
  const busy = notice?.kind === "busy";
  return (
    <Panel name="run-panel" title={p("run")}>
      <div class="run-row flex wrap gap-8 pad-0-16-8">
        <button class="action primary" data-moves disabled={why !== "" || busy} title={why} onClick={run}>
          {p("run_named", { name })}
        </button>
      </div>
      <NoticeLine notice={notice} idle={why || p("run_hint")} />
      {state && state.outcome !== Outcome.OUTCOME_UNSPECIFIED && <Progress state={state} />}
    </Panel>
  );
}

/** Explain why it cannot be run now; "" when it can. The gateway refuses collisions. */
function whyNotRun(robotKey: string, controller: ControllerState | undefined, running: boolean): string {
  if (!draft.value?.text.trim()) return p("run_empty");
  const error = isCurrent() ? errorsOf(checked.value?.answer)[0] : undefined;
  if (error) return p("run_error", { line: error.line, text: error.text });
  if (running) return p("run_running");
  if (!reachable.value) return t("no_connection");
  if (!holds(robotKey)) return p("run_take");
  return whyNoNewMotion(controller) || whyFrozen(robotKey, now.value);
}

const OUTCOMES: { [outcome: number]: ["is_running" | "is_done" | "is_ended", string] | undefined } = {
  [Outcome.RUNNING]: ["is_running", "motion"],
  [Outcome.DONE]: ["is_done", "normal"],
  [Outcome.ENDED]: ["is_ended", "alarm"],
};

function Progress({ state }: { state: ProgramState }) {
  const { outcome, name, operator, line, statement, step, steps, durationS, leftS, text } = state;
  const [kept, level] = OUTCOMES[outcome] ?? [undefined, "warning"];
  const word = kept ? p(kept) : String(outcome);
  return (
    <div class="progress grid gap-4 pad-0-16-8" role="group" aria-label={p("progress")} data-outcome={Outcome[outcome]}>
      {/* Only this is announced: the rest changes each second. */}
      <p class="progress-head flex wrap baseline gap-0-8" role="status">
        <span class={`state ${level}`}>
          <span class={`shape ${level}`} aria-hidden="true" />
          {word}
        </span>
        <strong>{name}</strong>
        <span class="dim small">{p("by_since", { name: operator, time: stampWhen(state.since) })}</span>
      </p>
      <progress
        max={Math.max(1, steps)}
        value={outcome === Outcome.DONE ? steps : Math.max(0, step - 1)}
        aria-label={name}
      />
      <p class="progress-line flex wrap baseline gap-0-8">
        {line > 0 && <span class="dim">{p("line", { line })}</span>} <code>{statement}</code>
        <span class="dim small">
          {p("step_of", { step, steps })}
          {outcome === Outcome.RUNNING &&
            leftS !== undefined &&
            ` · ${p("time_left", { left: clock(Math.ceil(leftS)), all: clock(Math.ceil(durationS)) })}`}
        </span>
      </p>
      {text && (
        <p class="progress-text break small" role="status">
          {reasonText(state.reason, text)}
        </p>
      )}
    </div>
  );
}
