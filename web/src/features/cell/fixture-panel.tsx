// The numbers of the chosen fixture or of the floor.

import { useId, useState } from "preact/hooks";
import type { CellFixture, CellFloor } from "../../gen/robomesh_pb";
import { cellText as c } from "../../i18n/texts";
import { Button } from "../../ui/inputs/button";
import { Choice, Toggle } from "../../ui/inputs/choice";
import { Panel } from "../../ui/panel/panel";
import { change, changeFixture, chosen, FLOOR, mayEdit, published, remove, rename, shownContent } from "./cell-draft";
import { dragging } from "./cell-preview";
import { Fields, NumberField, Vector } from "./fields";

export function FixturePanel() {
  const name = chosen.value;
  const content = shownContent.value;
  const fixture = content?.fixtures.find((each) => each.name === name);
  if (name === FLOOR && content?.floor) return <FloorPanel floor={content.floor} />;
  if (!fixture) {
    return (
      <Panel title={c("numbers")} name="cell-numbers">
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
        quantity="length"
        value={fixture.xyz}
        set={(axis, value) => set((each) => each.xyz && (each.xyz[axis] = value))}
      />
      <Vector
        key={`${name} rpy`}
        label={c("rotation")}
        quantity="angle"
        value={fixture.rpy}
        set={(axis, value) => set((each) => each.rpy && (each.rpy[axis] = value))}
      />
      <Shape fixture={fixture} set={set} />
      <Name key={`${name} name`} name={name} />
      <div class="cell-actions flex wrap gap-8 pad-8-16 to-end">
        <Button
          destructive
          text={c("remove")}
          type="button"
          disabled={!mayEdit.value}
          onClick={() => {
            remove(name);
            chosen.value = "";
          }}
        />
      </div>
    </Panel>
  );
}

function Shape({ fixture, set }: { fixture: CellFixture; set: (edit: (fixture: CellFixture) => void) => void }) {
  const { shape, name } = fixture;
  const size = (of: "radius" | "height", value: number, set: (value: number) => void) => (
    <NumberField key={`${name} ${of}`} label={c(of)} quantity="length" positive value={value} set={set} />
  );
  switch (shape.case) {
    case "box":
      return (
        <Vector
          key={`${name} box`}
          label={c("size")}
          quantity="length"
          positive
          value={shape.value}
          set={(axis, value) => set(({ shape }) => shape.case === "box" && (shape.value[axis] = value))}
        />
      );
    case "cylinder":
      return (
        <Fields label={c("size")}>
          {size("radius", shape.value.radius, (value) =>
            set(({ shape }) => shape.case === "cylinder" && (shape.value.radius = value)),
          )}
          {size("height", shape.value.height, (value) =>
            set(({ shape }) => shape.case === "cylinder" && (shape.value.height = value)),
          )}
        </Fields>
      );
    case "sphere":
      return (
        <Fields label={c("size")}>
          {size("radius", shape.value, (value) => set((each) => (each.shape = { case: "sphere", value })))}
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
      <div class="flex wrap gap-8 pad-8-16">
        <Toggle text={c("has_floor")} on={!floor.none} set={(on) => set((each) => (each.none = !on))} />
        {!floor.none && (
          <Toggle
            text={c("own_height")}
            on={floor.height !== undefined}
            set={(on) =>
              set((each) => {
                if (on) each.height = 0;
                else delete each.height;
              })
            }
          />
        )}
      </div>
      {!floor.none && floor.height !== undefined && (
        <Fields label={c("height")}>
          <NumberField
            label={c("height")}
            quantity="length"
            value={floor.height}
            set={(value) => set((each) => (each.height = value))}
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
    <div class="cell-fields pad-4-16-8">
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
