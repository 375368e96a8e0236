// Cell: what stands around a robot. Engineers place and move fixtures; the gateway changes all or nothing.

import type { ComponentChildren } from "preact";
import { useEffect, useId, useState } from "preact/hooks";
import { JointStatesSchema } from "../../gen/foxglove/JointStates_pb";
import type { CellAnswer, CellChange, CellFixture, CellFloor, CellMember, Vector3 } from "../../gen/robomesh_pb";
import {
  CellStateSchema,
  ControllerStateSchema,
  DescriptionSchema,
  CellChange_Kind as Kind,
} from "../../gen/robomesh_pb";
import { c } from "../../i18n/cell";
import { reasonText } from "../../i18n/reasons";
import { reasonOf } from "../../mesh/control";
import type { RobotName } from "../../mesh/robot-name";
import { stateWord } from "../../mesh/robot-state";
import { useShownState } from "../../mesh/sight";
import { isStale, jointsAge, useEvents, useTopic } from "../../mesh/topics";
import { RobotAlarm } from "../../panels/robot-alarm";
import { NoRobot, useRobotSearch } from "../../panels/robot-not-found";
import type { Stage } from "../../scene/robot-scene";
import { SceneView } from "../../scene/scene-view";
import { Choice, Toggle } from "../../ui/choice";
import { numberText, readNumber } from "../../ui/number-text";
import { Panel } from "../../ui/panel";
import { ReasonForm } from "../../ui/reason-form";
import { robotLink } from "../../ui/route";
import { State } from "../../ui/state";
import {
  account,
  add,
  askChange,
  beginUndo,
  change,
  changeFixture,
  chosen,
  discard,
  draft,
  isEdited,
  isEngineer,
  keep,
  type Mark,
  mayEdit,
  published,
  remove,
  rename,
  rows,
  shownContent,
} from "./cell-draft";
import { addPreview, dragging } from "./cell-preview";
import "./cell-page.css";

const MM = 1000;
const DEGREES = 180 / Math.PI;

export function CellPage({ site, robot }: RobotName) {
  const key = `robomesh/${site}/${robot}`;
  const controller = useTopic(ControllerStateSchema, `${key}/controller`);
  const description = useTopic(DescriptionSchema, `${key}/description`);
  const joints = useTopic(JointStatesSchema, `${key}/joints`);
  const cell = useTopic(CellStateSchema, `${key}/cell`);
  const events = useEvents(key);
  const [stage, setStage] = useState<Stage | null>(null);
  const age = jointsAge(joints, controller);
  const stale = isStale("joints", age);
  useShownState(key, joints, controller);
  useEffect(() => void (published.value = cell?.message ?? null), [cell]);
  useEffect(
    () => () => {
      published.value = draft.value = null;
      chosen.value = "";
      dragging.value = "off";
    },
    [key],
  );
  const described = description?.message;
  useEffect(
    () => (stage && described ? addPreview(stage, `${site}/${robot}`, described) : undefined),
    [stage, described?.cellVersion],
  );
  const search = useRobotSearch(key, Boolean(controller ?? description ?? cell));
  if (search !== "found") return <NoRobot search={search} site={site} robot={robot} />;
  const state = cell?.message;
  return (
    <>
      <RobotAlarm state={controller?.message} events={events} />
      <div class="cell-page">
        <div class="headline">
          <div class="glance">
            <div class="who">
              <h1 title={robot}>{c("cell_of", { robot })}</h1>
              <State state={stateWord(controller, events)} />
            </div>
            <span class="facts dim">
              {state && (state.cell ? c("cell_named", { cell: state.cell }) : c("no_cell_name"))}
            </span>
          </div>
          <div class="about-robot">
            <a class="page-link" href={robotLink(site, robot)}>
              {c("to_robot")}
            </a>
          </div>
        </div>
        <SceneView
          robotKey={key}
          description={described}
          stale={stale}
          age={joints ? age : undefined}
          lostAt={null}
          staged={setStage}
        />
        <div class="cell-side">
          {state ? (
            <>
              <ContentPanel robotKey={key} />
              <FixturePanel />
              <RobotsPanel robots={state.robots} />
            </>
          ) : (
            <p class="panel notice">{c("waiting", { robot })}</p>
          )}
        </div>
      </div>
    </>
  );
}

function ContentPanel({ robotKey }: { robotKey: string }) {
  const [review, setReview] = useState<CellAnswer | null>(null);
  const [said, setSaid] = useState<{ text: string; kind: "" | "done" | "refused" }>({ text: "", kind: "" });
  const [busy, setBusy] = useState(false);
  const state = published.value;
  const may = mayEdit.value && !busy;
  const outdated = draft.value !== null && state !== null && draft.value.basedOn !== state.version && !busy;
  const run = async (work: () => Promise<void>) => {
    setBusy(true);
    try {
      await work();
    } catch (error) {
      setSaid({ text: reasonOf(error), kind: "refused" });
    } finally {
      setBusy(false);
    }
  };
  const look = () =>
    run(async () => {
      setSaid({ text: "", kind: "" });
      setReview(await askChange(robotKey, true));
    });
  const confirm = (reason: string) =>
    run(async () => {
      const answer = await askChange(robotKey, false, reason);
      discard();
      setSaid({ text: c("done", { changes: answer.changes.map(changeText).join("; ") }), kind: "done" });
    });
  return (
    <Panel
      title={c("fixtures")}
      name="cell-content"
      end={
        <button
          type="button"
          class="quiet"
          disabled={!may || !state?.previous || review !== null}
          onClick={() => {
            beginUndo();
            void look();
          }}
        >
          {c("undo")}
        </button>
      }
    >
      <ul class="cell-rows">
        <Row name="" kind={c("floor")} detail={floorText(shownContent.value?.floor)} mark={floorMark()} />
        {rows.value.map(({ fixture, mark }) => (
          <Row
            key={fixture.name}
            name={fixture.name}
            kind={kindText(fixture)}
            detail={placeText(fixture)}
            mark={mark}
          />
        ))}
      </ul>
      {state?.cell && (
        <div class="cell-add" role="group" aria-label={c("add")}>
          {(["box", "cylinder", "sphere"] as const).map((kind) => (
            <button type="button" class="action" key={kind} disabled={!may} onClick={() => add(kind)}>
              {c(`add_${kind}`)}
            </button>
          ))}
        </div>
      )}
      {review ? (
        <ReasonForm
          title={c("review_title")}
          text={c("review_text", { file: state?.file || "site.toml" })}
          does={c("change")}
          close={() => setReview(null)}
          done={(reason) => void confirm(reason)}
        >
          <ul class="cell-changes">
            {review.changes.map((each) => (
              <li key={`${each.fixture}.${each.key}`}>{changeText(each)}</li>
            ))}
          </ul>
        </ReasonForm>
      ) : (
        <div class="cell-actions">
          <button
            type="button"
            class="action"
            disabled={!draft.value || busy}
            onClick={() => {
              discard();
              setSaid({ text: "", kind: "" });
            }}
          >
            {c("discard")}
          </button>
          <button type="button" class="action primary" disabled={!may || !isEdited.value} onClick={() => void look()}>
            {c("review")}
          </button>
        </div>
      )}
      <p class={`notice ${said.kind}`} role="status">
        {notice(said.text, outdated, busy)}
      </p>
    </Panel>
  );
}

function notice(said: string, outdated: boolean, busy: boolean): string {
  const state = published.value;
  if (state?.changing || (busy && !said)) return c("changing");
  if (outdated) return c("outdated");
  if (said) return said;
  if (!isEngineer.value) return c("read_only", { account: account.value });
  if (state?.problem) return c("cannot", { text: reasonText(state.problem, state.problem.text) });
  return isEdited.value ? c("preview") : "";
}

function Row(props: { name: string; kind: string; detail: string; mark: Mark }) {
  const { name, mark } = props;
  const label = name || c("floor");
  const value = name || FLOOR;
  const old = published.value?.content?.fixtures.find((each) => each.name === name);
  return (
    <li class={`cell-row ${mark}`}>
      <button
        type="button"
        class="cell-pick"
        aria-pressed={chosen.value === value}
        onClick={() => (chosen.value = value)}
      >
        <strong>{label}</strong>
        <span class="dim">{name ? `${props.kind} · ${props.detail}` : props.detail}</span>
      </button>
      {mark && <span class="cell-mark">{c(mark)}</span>}
      {mark === "removed" && old && (
        <button type="button" class="quiet" disabled={!mayEdit.value} onClick={() => keep(old)}>
          {c("keep")}
        </button>
      )}
    </li>
  );
}

// No fixture can have this name.
const FLOOR = "the floor";

function FixturePanel() {
  const name = chosen.value;
  const content = shownContent.value;
  const fixture = content?.fixtures.find((each) => each.name === name);
  if (name === FLOOR && content?.floor) return <FloorPanel floor={content.floor} />;
  if (!fixture) {
    return (
      <Panel title={c("fixtures")} name="cell-numbers">
        <p class="notice">{c("choose_fixture")}</p>
      </Panel>
    );
  }
  const set = (edit: (fixture: CellFixture) => void) => changeFixture(name, edit);
  return (
    <Panel
      title={name}
      name="cell-numbers"
      end={
        <Choice
          label={c("drag")}
          values={["off", "translate", "rotate"] as const}
          chosen={dragging.value}
          text={(value) => c(value === "off" ? "drag_off" : value === "translate" ? "drag_move" : "drag_turn")}
          choose={(value) => (dragging.value = value)}
        />
      }
    >
      <Vector
        key={`${name} xyz`}
        label={c("position")}
        names={["x", "y", "z"]}
        unit="mm"
        factor={MM}
        step={1}
        value={fixture.xyz}
        set={(axis, value) => set((each) => each.xyz && (each.xyz[axis] = value))}
      />
      <Vector
        key={`${name} rpy`}
        label={c("rotation")}
        names={["x", "y", "z"]}
        unit="°"
        factor={DEGREES}
        step={1}
        value={fixture.rpy}
        set={(axis, value) => set((each) => each.rpy && (each.rpy[axis] = value))}
      />
      <Shape fixture={fixture} set={set} />
      <Name key={`${name} name`} name={name} />
      <div class="cell-actions">
        <button
          type="button"
          class="action destructive"
          disabled={!mayEdit.value}
          onClick={() => {
            remove(name);
            chosen.value = "";
          }}
        >
          {c("remove")}
        </button>
      </div>
    </Panel>
  );
}

function Shape({ fixture, set }: { fixture: CellFixture; set: (edit: (fixture: CellFixture) => void) => void }) {
  const { shape, name } = fixture;
  switch (shape.case) {
    case "box":
      return (
        <Vector
          key={`${name} box`}
          label={c("size")}
          names={["x", "y", "z"]}
          unit="mm"
          factor={MM}
          step={1}
          positive
          value={shape.value}
          set={(axis, value) => set(({ shape }) => shape.case === "box" && (shape.value[axis] = value))}
        />
      );
    case "cylinder":
      return (
        <Fields label={c("size")}>
          <NumberInput
            key={`${name} radius`}
            label={c("radius")}
            unit="mm"
            step={1}
            positive
            value={shape.value.radius * MM}
            set={(value) => set(({ shape }) => shape.case === "cylinder" && (shape.value.radius = value / MM))}
          />
          <NumberInput
            key={`${name} height`}
            label={c("cylinder_height")}
            unit="mm"
            step={1}
            positive
            value={shape.value.height * MM}
            set={(value) => set(({ shape }) => shape.case === "cylinder" && (shape.value.height = value / MM))}
          />
        </Fields>
      );
    case "sphere":
      return (
        <Fields label={c("size")}>
          <NumberInput
            key={`${name} radius`}
            label={c("radius")}
            unit="mm"
            step={1}
            positive
            value={shape.value * MM}
            set={(value) => set((each) => (each.shape = { case: "sphere", value: value / MM }))}
          />
        </Fields>
      );
    case "mesh":
      return (
        <p class="notice">
          {c("mesh")}: <code>{shape.value.file}</code>
        </p>
      );
    default:
      return null;
  }
}

function FloorPanel({ floor }: { floor: CellFloor }) {
  const set = (edit: (floor: CellFloor) => void) => change((content) => content.floor && edit(content.floor));
  return (
    <Panel title={c("floor")} name="cell-numbers">
      <div class="cell-toggles">
        <Toggle on={!floor.none} set={(on) => set((each) => (each.none = !on))}>
          {c("has_floor")}
        </Toggle>
        {!floor.none && (
          <Toggle
            on={floor.height !== undefined}
            set={(on) =>
              set((each) => {
                if (on) each.height = 0;
                else delete each.height;
              })
            }
          >
            {c("own_height")}
          </Toggle>
        )}
      </div>
      {!floor.none && floor.height !== undefined && (
        <Fields label={c("height")}>
          <NumberInput
            label={c("height")}
            unit="mm"
            step={1}
            value={floor.height * MM}
            set={(value) => set((each) => (each.height = value / MM))}
          />
        </Fields>
      )}
    </Panel>
  );
}

function Name({ name }: { name: string }) {
  const id = useId();
  const [wrong, setWrong] = useState(false);
  const isNew = !published.value?.content?.fixtures.some((each) => each.name === name);
  if (!isNew) return null;
  return (
    <div class="cell-fields">
      <label for={id}>{c("name")}</label>
      <input
        id={id}
        type="text"
        defaultValue={name}
        maxLength={64}
        aria-invalid={wrong}
        disabled={!mayEdit.value}
        onChange={(event) => setWrong(!rename(name, event.currentTarget.value.trim()))}
      />
      {wrong && <span class="notice refused">{c("name_taken")}</span>}
    </div>
  );
}

function Fields(props: { label: string; children: ComponentChildren }) {
  return (
    <fieldset class="cell-fields">
      <legend>{props.label}</legend>
      <div class="cell-numbers-row">{props.children}</div>
    </fieldset>
  );
}

type Axis = "x" | "y" | "z";

function Vector(props: {
  label: string;
  names: readonly Axis[];
  unit: string;
  /** From SI to the unit. */
  factor: number;
  step: number;
  positive?: boolean;
  value: Vector3 | undefined;
  set: (axis: Axis, value: number) => void;
}) {
  return (
    <Fields label={props.label}>
      {props.names.map((axis) => (
        <NumberInput
          key={axis}
          label={axis}
          unit={props.unit}
          step={props.step}
          positive={props.positive ?? false}
          value={(props.value?.[axis] ?? 0) * props.factor}
          set={(value) => props.set(axis, value / props.factor)}
        />
      ))}
    </Fields>
  );
}

/** A number with its unit. Arrow keys step it; invalid text stays, marked, until it is corrected. */
function NumberInput(props: {
  label: string;
  unit: string;
  step: number;
  positive?: boolean;
  value: number;
  set: (value: number) => void;
}) {
  const id = useId();
  const [typed, setTyped] = useState<string | null>(null);
  const valid = (text: string) => {
    const value = readNumber(text);
    return value === null || (props.positive && value <= 0) ? null : value;
  };
  const wrong = typed !== null && valid(typed) === null;
  return (
    <span class={`cell-number ${wrong ? "wrong" : ""}`}>
      <label for={id}>{props.label}</label>
      <input
        id={id}
        type="text"
        inputMode="decimal"
        autocomplete="off"
        aria-invalid={wrong}
        disabled={!mayEdit.value}
        value={typed ?? numberText(Math.round(props.value * 1e3) / 1e3)}
        onInput={(event) => {
          const text = event.currentTarget.value;
          setTyped(text);
          const value = valid(text);
          if (value !== null) props.set(value);
        }}
        onBlur={() => !wrong && setTyped(null)}
        onKeyDown={(event) => {
          const direction = { ArrowUp: 1, ArrowDown: -1 }[event.key];
          if (event.key === "Escape" || event.key === "Enter") setTyped(null);
          if (!direction) return;
          event.preventDefault();
          setTyped(null);
          const value = props.value + props.step * (event.shiftKey ? 10 : 1) * direction;
          if (!props.positive || value > 0) props.set(value);
        }}
      />
      <span class="dim">{props.unit}</span>
    </span>
  );
}

/** The robots of the cell, for reading. */
function RobotsPanel({ robots }: { robots: readonly CellMember[] }) {
  return (
    <Panel title={c("robots")} name="cell-robots">
      <p class="notice">{c("needs_restart")}</p>
      {robots.map((robot) => (
        <dl class="cell-facts" key={robot.name} aria-label={robot.name}>
          <dt class="cell-robot">{robot.name}</dt>
          <dd />
          <Fact name={c("model")}>{robot.model}</Fact>
          <Fact name={c("base")}>
            {vectorText(robot.xyz, MM, "mm")} · {vectorText(robot.rpy, DEGREES, "°")}
          </Fact>
          <Fact name={c("controller")}>
            {robot.controller} ({robot.protocol})
          </Fact>
          <Fact name={c("check")}>{robot.check}</Fact>
          <Fact name={c("clearance")}>
            {numberText(robot.warningDistance * MM)}, {numberText(robot.stopDistance * MM)} mm
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

function kindText({ shape }: CellFixture): string {
  return shape.case === "mesh" ? c("mesh_kind") : shape.case ? c(shape.case) : "";
}

function placeText({ xyz }: CellFixture): string {
  return vectorText(xyz, MM, "mm");
}

function vectorText(vector: Vector3 | undefined, factor: number, unit: string): string {
  const { x = 0, y = 0, z = 0 } = vector ?? {};
  return `${[x, y, z].map((each) => numberText(Math.round(each * factor * 10) / 10)).join(", ")} ${unit}`;
}

function floorText(floor: CellFloor | undefined): string {
  if (!floor || floor.none) return c("no_floor");
  return floor.height === undefined ? c("lowest_base") : `${numberText(floor.height * MM)} mm`;
}

function floorMark(): Mark {
  const before = floorText(published.value?.content?.floor);
  return draft.value && floorText(draft.value.content.floor) !== before ? "changed" : "";
}

/** Return a change in words; numbers are as in the site file. */
function changeText(change: CellChange): string {
  const name = change.fixture || c("floor");
  if (change.kind === Kind.ADDED) return c("change_added", { name });
  if (change.kind === Kind.REMOVED) return c("change_removed", { name });
  const minus = (text: string) => text.replaceAll("-", "−");
  return c("change_value", { name, key: change.key, before: minus(change.before), after: minus(change.after) });
}
