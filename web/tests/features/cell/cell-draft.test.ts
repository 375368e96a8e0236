// A change of a cell: a copy of what is published, until the gateway has it.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { beforeEach, expect, test } from "vitest";
import {
  CellAnswerSchema,
  CellChangeSchema,
  CellFloorSchema,
  CellRequestSchema,
  CellStateSchema,
  CellChange_Kind as Kind,
} from "../../../src/gen/robomesh_pb";
import { answer, connect, newPage, next, read } from "../../console";
import { ARM } from "../../recorded";

let cell: typeof import("../../../src/features/cell/cell-draft");
let words: typeof import("../../../src/features/cell/cell-text");
let account: typeof import("../../../src/mesh/console/account");

const box = (name: string, x = 0) =>
  ({ name, shape: { case: "box", value: { x: 1, y: 1, z: 1 } }, xyz: { x } }) as const;
const PUBLISHED: MessageInitShape<typeof CellStateSchema> = {
  ...{ cell: "hall", version: "v1", content: { fixtures: [box("fence"), box("table")] } },
  ...{ robots: [{ name: "arm" }], previous: { fixtures: [box("fence")] } },
};
const STATE = create(CellStateSchema, PUBLISHED);

beforeEach(async () => {
  newPage();
  cell = await import("../../../src/features/cell/cell-draft");
  words = await import("../../../src/features/cell/cell-text");
  account = await import("../../../src/mesh/console/account");
  cell.published.value = STATE;
});
const rows = () => cell.rows.value.map(({ fixture, mark }) => `${fixture.name} ${mark}`.trim());

test("each fixture says what happens to it, and the published cell is not touched", () => {
  cell.remove("fence");
  cell.changeFixture("table", (fixture) => (fixture.color = "#fff"));
  cell.add("box");
  expect(rows()).toEqual(["box-1 added", "fence removed", "table changed"]);
  expect(STATE.content?.fixtures.map(({ name, color }) => [name, color])).toEqual([
    ["fence", ""],
    ["table", ""],
  ]);
  cell.discard();
  expect(rows()).toEqual(["fence", "table"]);
});

test("a change that is taken back is none, in whatever order", () => {
  const [fence] = STATE.content?.fixtures ?? [];
  cell.remove("fence");
  expect(cell.isEdited.value).toBe(true);
  if (fence) cell.keep(fence);
  expect([cell.isEdited.value, rows()]).toEqual([false, ["fence", "table"]]);
});

test.each([
  ["an engineer", { accounts: true, role: "engineer" }, {}, true],
  ["an administrator", { accounts: true, role: "admin" }, {}, true],
  ["an operator", { accounts: true, role: "operator" }, {}, false],
  ["a monitor", { accounts: true, role: "monitor" }, {}, false],
  ["without accounts, anybody", { accounts: false, role: "" }, {}, true],
  ["nobody while the gateway changes it", { accounts: false }, { changing: true }, false],
  ["nobody while the cell has a problem", { accounts: false }, { problem: { code: "x" } }, false],
])("%s may edit: %#", (_, me, state, may) => {
  account.me.value = me as typeof account.me.value;
  cell.published.value = create(CellStateSchema, { ...PUBLISHED, ...state } as typeof PUBLISHED);
  expect(cell.mayEdit.value).toBe(may);
  cell.remove("fence");
  expect(cell.draft.value !== null).toBe(may);
});

test.each([
  ["post", true],
  ["fence", true],
  ["table", false],
  ["arm", false],
  ["Post", false],
  ["", false],
])("a fence can be named %j: %s", (name, done) => {
  expect(cell.rename("fence", name)).toBe(done);
  expect(cell.draft.value?.content.fixtures.some((each) => each.name === name) ?? false).toBe(done);
});

test.each([
  ["box", { x: 0.2, y: 0.2, z: 0.2 }],
  ["cylinder", { radius: 0.1, height: 0.2 }],
  ["sphere", 0.1],
] as const)("a new %s stands on the floor, is chosen, and has a free name", (kind, shape) => {
  cell.add(kind);
  cell.add(kind);
  const [first, second] = cell.draft.value?.content.fixtures.slice(-2) ?? [];
  expect([first?.name, second?.name, cell.chosen.value]).toEqual([`${kind}-1`, `${kind}-2`, `${kind}-2`]);
  expect(first?.shape.value).toMatchObject(typeof shape === "object" ? shape : {});
  expect(first?.xyz?.z).toBe(0.1);
});

test("a change names the version that it began with, also after another one was published", async () => {
  await connect();
  cell.remove("fence");
  cell.published.value = create(CellStateSchema, { ...PUBLISHED, version: "v2" });
  cell.remove("table");
  const asked = cell.askChange(ARM, true, "moved");
  const request = await next();
  const { basedOn, dryRun, reason, content } = read(request, CellRequestSchema);
  expect([request.key, basedOn, dryRun, reason, content?.fixtures]).toEqual([
    `${ARM}/cell/request/page1`,
    "v1",
    true,
    "moved",
    [],
  ]);
  answer(request, CellAnswerSchema, {});
  await asked;
});

test("an undo is a change back to what was before the last one", () => {
  cell.beginUndo();
  expect([rows(), cell.isEdited.value, cell.draft.value?.basedOn]).toEqual([["fence", "table removed"], true, "v1"]);
});

test.each([
  [{ none: true }, /^none$/],
  [{}, /lowest/i],
  [{ height: -0.05 }, "−50 mm"],
])("the floor %j is in words", (floor, text) => {
  expect(words.floorText(create(CellFloorSchema, floor))).toMatch(text);
});

test.each([
  [{ kind: Kind.ADDED, fixture: "table" }, /table/],
  [{ kind: Kind.REMOVED, fixture: "table" }, /table/],
  [{ fixture: "table", key: "xyz", before: "[-1.5, 0]", after: "[a-b, -2]" }, /table.*xyz.*−1.5.*a-b, −2/],
])("a change is in words, with true minus signs: %j", (change, text) => {
  expect(words.changeText(create(CellChangeSchema, change))).toMatch(text);
});
