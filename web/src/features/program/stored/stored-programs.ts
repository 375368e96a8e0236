// Programs that the site stores for the robot: their list, and the requests that read and change them.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { computed, signal } from "@preact/signals";
import type {
  ProgramAnswer,
  ProgramContent,
  ProgramList,
  ProgramVersion,
  StoredProgram,
} from "../../../gen/robomesh_pb";
import {
  ProgramRequest_Action as Action,
  ProgramVersion_Change as Change,
  ProgramAnswerSchema,
  ProgramContentSchema,
  ProgramQuerySchema,
  ProgramRequestSchema,
} from "../../../gen/robomesh_pb";
import { stampFull } from "../../../i18n/format";
import type { Words } from "../../../i18n/texts";
import { noWords, programText as p, storedText as s } from "../../../i18n/texts";
import { mayAct } from "../../../mesh/console/account";
import { ask, inOwnName, reasonOf } from "../../../mesh/console/connection";
import type { Base } from "../draft/draft";
import { draft, replaceDraft, setBase } from "../draft/draft";

const TIMEOUT_S = 10;

/** The stored programs, deleted ones too; null: no store has answered yet. */
export const stored = signal<ProgramList | null>(null);
/** What the panel of programs shows instead of the text; null: the text. */
export const shown = signal<Shown | null>(null);
export const saving = signal(false);
/** The lastAction of the last action. */
export const lastAction = signal<{ words: Words; refused: boolean }>({ words: noWords, refused: false });

export type Shown =
  | { kind: "list" }
  /** Two versions of one program; `against` null: the draft. */
  | { kind: "program"; content: ProgramContent; against: number | null; old: ProgramContent | null }
  /** A save was put aside: `mine` next to the current version. */
  | { kind: "conflict"; mine: ProgramContent; theirs: ProgramContent }
  | { kind: "run"; content: ProgramContent }
  | { kind: "loading" };

export const isDeleted = (program: StoredProgram): boolean => program.current?.change === Change.DELETED;

/** The stored program of the draft; undefined: never saved, or the list is not known. */
export const programOfDraft = computed(() =>
  stored.value?.programs.find((program) => program.id === draft.value?.base?.id),
);

export const timeOf = (version: ProgramVersion | undefined): string => stampFull(version?.timestamp);

/** Return a name that no stored program has. */
export function unusedProgramName(): string {
  const names = new Set(stored.value?.programs.map((each) => each.current?.name.toLowerCase()));
  for (let number = 1; ; number++) {
    const name = number === 1 ? p("default_name") : `${p("default_name")}-${number}`;
    if (!names.has(name)) return name;
  }
}

export function say(words: Words, refused = false): void {
  lastAction.value = { words, refused };
}

function siteKey(robotKey: string, request: string): string {
  const [root, site] = robotKey.split("/");
  return `${root}/${site}/-/programs/${request}`;
}

async function change(
  robotKey: string,
  request: MessageInitShape<typeof ProgramRequestSchema>,
): Promise<ProgramAnswer> {
  const key = inOwnName(siteKey(robotKey, "request"));
  const whole = { ...request, robot: robotKey.split("/")[2] ?? "" };
  return await ask(key, ProgramRequestSchema, whole, ProgramAnswerSchema, TIMEOUT_S);
}

export async function read(
  robotKey: string,
  query: MessageInitShape<typeof ProgramQuerySchema>,
): Promise<ProgramContent> {
  const whole = { ...query, robot: robotKey.split("/")[2] ?? "" };
  return await ask(siteKey(robotKey, "read"), ProgramQuerySchema, whole, ProgramContentSchema, TIMEOUT_S);
}

/** Do something with the store, and say why it failed. */
export async function attempt(work: () => Promise<void>): Promise<void> {
  try {
    await work();
  } catch (error) {
    const reason = reasonOf(error);
    say(() => reason, true);
    if (shown.value?.kind === "loading") shown.value = { kind: "list" };
  }
}

const baseOf = (id: string, version: ProgramVersion, text: string): Base => ({
  id,
  version: version.number,
  name: version.name,
  text,
});

/** Save the draft: a new version of its program, or a new program if it was never saved or has another name. */
export async function save(): Promise<void> {
  const now = draft.value;
  if (!now?.text || saving.value || !mayAct.value) return;
  const base = now.base && now.base.name === now.name ? now.base : null;
  saving.value = true;
  say(() => s("saving"));
  await attempt(async () => {
    const request = { action: Action.SAVE, id: base?.id ?? "", basedOn: base?.version ?? 0, name: now.name };
    const { program, version } = await change(now.robotKey, { ...request, text: now.text });
    if (!program || !version) return;
    if (version.change === Change.ASIDE) return await showConflict(now.robotKey, program, version.number);
    const unchanged = base !== null && version.number === base.version;
    say(() => s(unchanged ? "unchanged" : "saved", { version: version.number }));
    // The user may type meanwhile: the base is the saved text.
    if (draft.value?.robotKey === now.robotKey) setBase(baseOf(program.id, version, now.text));
  });
  saving.value = false;
}

async function showConflict(robotKey: string, { id, current }: StoredProgram, mine: number): Promise<void> {
  shown.value = {
    kind: "conflict",
    mine: await read(robotKey, { id, version: mine }),
    theirs: await read(robotKey, { id, version: current?.number ?? 0 }),
  };
  say(noWords);
}

/** Show a program's version with the one before it, or with `against`; 0: the current version. */
export async function showVersion(robotKey: string, id: string, version = 0, against?: number | null): Promise<void> {
  await attempt(async () => {
    const content = await read(robotKey, { id, version });
    const number = content.version?.number ?? 0;
    const before = against === undefined ? Math.max(1, number - 1) : against;
    const old = before === null ? null : await read(robotKey, { id, version: before });
    shown.value = { kind: "program", content, against: before, old };
  });
}

/** Show the text with a SHA-256 of the audit log. */
export async function showHash(robotKey: string, sha256: string): Promise<void> {
  shown.value = { kind: "loading" };
  await attempt(async () => {
    const content = await read(robotKey, { sha256 });
    const number = content.version?.number;
    if (content.program) await showVersion(robotKey, content.program.id, number, number);
    else shown.value = { kind: "run", content };
  });
}

/** Open a version in the editor, as one undo step. */
export function open({ program, version, text }: ProgramContent): void {
  if (!version) return;
  const current = program?.current?.number ?? 0;
  // An older version is edited as a change of the current one.
  const base = program ? { ...baseOf(program.id, version, text), version: current } : null;
  const name = program?.current?.name ?? version.name;
  const isCurrent = version.sha256 === program?.current?.sha256;
  replaceDraft({ text, name, base: base && { ...base, name, text: isCurrent ? text : "" } });
  shown.value = null;
  say(() => s("opened", { name, version: version.number }));
}

/** Make an older version, or one that was put aside, the newest version. */
export async function restore(robotKey: string, content: ProgramContent): Promise<void> {
  const { program, version, text } = content;
  if (!program || !version) return;
  await attempt(async () => {
    const request = { action: Action.RESTORE, id: program.id, basedOn: program.current?.number ?? 0 };
    const { version: made } = await change(robotKey, { ...request, version: version.number });
    if (!made) return;
    if (draft.value?.base?.id === program.id && draft.value.text === text) setBase(baseOf(program.id, made, text));
    say(() => s("restored", { from: version.number, version: made.number }));
    await showVersion(robotKey, program.id);
  });
}

export async function rename(robotKey: string, { id, current }: StoredProgram, name: string): Promise<void> {
  await attempt(async () => {
    const { version } = await change(robotKey, { action: Action.RENAME, id, basedOn: current?.number ?? 0, name });
    const base = draft.value?.base;
    if (version && base?.id === id) setBase({ ...base, name: version.name, version: version.number });
    say(() => s("renamed"));
    await showVersion(robotKey, id);
  });
}

export async function remove(robotKey: string, { id, current }: StoredProgram, reason: string): Promise<void> {
  await attempt(async () => {
    await change(robotKey, { action: Action.DELETE, id, basedOn: current?.number ?? 0, reason });
    say(() => s("deleted_now", { name: current?.name ?? "" }));
    shown.value = { kind: "list" };
  });
}

/** Save a file's text as a program: a new version if there is one of that name. */
export async function importText(robotKey: string, name: string, text: string): Promise<void> {
  await attempt(async () => {
    const there = stored.value?.programs.find((each) => each.current?.name === name && !isDeleted(each));
    const request = { action: Action.SAVE, id: there?.id ?? "", basedOn: there?.current?.number ?? 0, name, text };
    const { version } = await change(robotKey, request);
    say(() => s("imported", { name, version: version?.number ?? 0 }));
  });
}
