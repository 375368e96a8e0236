// The robots of a cell and their settings.

import type { ComponentChildren } from "preact";
import type { CellMember } from "../../gen/robomesh_pb";
import { cellText as c } from "../../i18n/texts";
import { Panel } from "../../ui/panel/panel";
import { lengthText, vectorText } from "./cell-text";

/** The robots, for reading: their settings need the site file and a restart. */
export function RobotsPanel({ robots }: { robots: readonly CellMember[] }) {
  return (
    <Panel title={c("robots")} name="cell-robots">
      <p class="notice">{c("needs_restart")}</p>
      {robots.map((robot) => (
        <dl class="cell-facts grid small" key={robot.name} aria-label={robot.name}>
          <dt class="cell-robot">{robot.name}</dt>
          <dd />
          <Fact name={c("model")}>{robot.model}</Fact>
          <Fact name={c("base")}>
            {vectorText(robot.xyz, "length")} · {vectorText(robot.rpy, "angle")}
          </Fact>
          <Fact name={c("controller")}>
            {robot.controller} ({robot.protocol})
          </Fact>
          <Fact name={c("check")}>{robot.check}</Fact>
          <Fact name={c("clearance")}>
            {lengthText(robot.warningDistance)}, {lengthText(robot.stopDistance)}
          </Fact>
          <Fact name={c("stop_proven")}>{c(robot.stopProven ? "yes" : "no")}</Fact>
        </dl>
      ))}
    </Panel>
  );
}

function Fact(props: { name: string; children: ComponentChildren }) {
  return (
    <>
      <dt class="dim">{props.name}</dt>
      <dd>{props.children}</dd>
    </>
  );
}
