// The change of a cell that is being prepared in this page: a copy of the published content, edited.

import { clone, create, equals } from "@bufbuild/protobuf";
import { computed, signal } from "@preact/signals";
import type { CellAnswer, CellContent, CellFixture, CellState } from "../../gen/robomesh_pb";
import { CellAnswerSchema, CellContentSchema, CellFixtureSchema, CellRequestSchema } from "../../gen/robomesh_pb";
import { isEngineer } from "../../mesh/console/account";
import { ask, hello, inOwnName } from "../../mesh/console/connection";

/** The gateway waits for kinematics and for its own checks. */
const TIMEOUT_S = 60;
const NAME = /^[a-z0-9][a-z0-9_-]{0,63}$/;
const NEW_SIZE_M = 0.2;

/** The published cell; null: not known yet. */
export const published = signal<CellState | null>(null);
/** The edited content and the version that it began with; null: nothing is edited. */
export const draft = signal<{ basedOn: string; content: CellContent } | null>(null);
/** Name of the chosen fixture; empty: none. */
export const chosen = signal("");
/** What `chosen` has for the floor: no fixture can have this name. */
export const FLOOR = "the floor";

export const shownContent = computed(() => draft.value?.content ?? published.value?.content ?? null);
export const isEdited = computed(() => {
  const before = published.value?.content;
  return Boolean(draft.value && before && !equals(CellContentSchema, before, sorted(draft.value.content)));
});
export const mayEdit = computed(
  () => isEngineer.value && Boolean(published.value && !published.value.problem && !published.value.changing),
);

export type Mark = "" | "added" | "changed" | "removed";

function sorted(content: CellContent): CellContent {
  const copy = clone(CellContentSchema, content);
  copy.fixtures.sort((one, other) => (one.name < other.name ? -1 : 1));
  return copy;
}

/** Edit the content; `edit` changes the copy that it receives. */
export function change(edit: (content: CellContent) => void): void {
  const state = published.value;
  const before = shownContent.value;
  if (!state || !before || !mayEdit.value) return;
  const content = clone(CellContentSchema, before);
  edit(content);
  draft.value = { basedOn: draft.value?.basedOn ?? state.version, content };
}

/** Edit one fixture. */
export function changeFixture(name: string, edit: (fixture: CellFixture) => void): void {
  change((content) => {
    const fixture = content.fixtures.find((each) => each.name === name);
    if (fixture) edit(fixture);
  });
}

/** Give a fixture another name; false: the name is taken or invalid. */
export function rename(name: string, wanted: string): boolean {
  const taken = [
    ...(shownContent.value?.fixtures.map((each) => each.name) ?? []),
    ...(published.value?.robots.map((each) => each.name) ?? []),
  ];
  if (!NAME.test(wanted) || (wanted !== name && taken.includes(wanted))) return false;
  changeFixture(name, (fixture) => (fixture.name = wanted));
  chosen.value = wanted;
  return true;
}

/** Add a fixture at the site's origin, and choose it. */
export function add(kind: "box" | "cylinder" | "sphere"): void {
  const names = new Set(shownContent.value?.fixtures.map((each) => each.name));
  let number = 1;
  while (names.has(`${kind}-${number}`)) number++;
  const size = NEW_SIZE_M;
  const fixture = create(CellFixtureSchema, {
    name: `${kind}-${number}`,
    shape:
      kind === "box"
        ? { case: "box", value: { x: size, y: size, z: size } }
        : kind === "cylinder"
          ? { case: "cylinder", value: { radius: size / 2, height: size } }
          : { case: "sphere", value: size / 2 },
    xyz: { z: size / 2 },
    rpy: {},
    color: "#8a8f94",
  });
  change((content) => content.fixtures.push(fixture));
  chosen.value = fixture.name;
}

/** Remove a fixture. */
export function remove(name: string): void {
  change((content) => {
    content.fixtures = content.fixtures.filter((each) => each.name !== name);
  });
}

/** Bring a removed fixture back. */
export function keep(fixture: CellFixture): void {
  change((content) => content.fixtures.push(clone(CellFixtureSchema, fixture)));
}

export function discard(): void {
  draft.value = null;
}

/** Begin a change back to the content before the last one. */
export function beginUndo(): void {
  const state = published.value;
  if (state?.previous) draft.value = { basedOn: state.version, content: clone(CellContentSchema, state.previous) };
}

/** Return the fixtures of the published content and of the draft, with what happens to each. */
export const rows = computed((): { fixture: CellFixture; mark: Mark }[] => {
  const before = published.value?.content?.fixtures ?? [];
  const after = shownContent.value?.fixtures ?? [];
  const found = after.map((fixture) => {
    const old = before.find((each) => each.name === fixture.name);
    const mark: Mark = !old ? "added" : equals(CellFixtureSchema, old, fixture) ? "" : "changed";
    return { fixture, mark };
  });
  const gone = before.filter((old) => !after.some((each) => each.name === old.name));
  return [...found, ...gone.map((fixture) => ({ fixture, mark: "removed" as const }))].sort((one, other) =>
    one.fixture.name < other.fixture.name ? -1 : 1,
  );
});

/** Ask the gateway for the change, or what it would change.
 *
 * @throws AskError with the reason in words. */
export async function askChange(robotKey: string, dryRun: boolean, reason = ""): Promise<CellAnswer> {
  const { basedOn, content } = draft.value ?? { basedOn: "", content: create(CellContentSchema) };
  return await ask(
    inOwnName(`${robotKey}/cell/request`),
    CellRequestSchema,
    { basedOn, content, dryRun, reason },
    CellAnswerSchema,
    TIMEOUT_S,
  );
}

/** The account's name, for the text about the right. */
export const account = computed(() => hello.value?.account ?? "");
