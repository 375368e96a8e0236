// The draft: one a robot, kept in the browser while it is typed, with its own undo and redo.
//
// The text field's undo takes seconds for a thousand lines, and loses what the page writes.

import { computed, effect, signal } from "@preact/signals";
import { programText as p } from "../../../i18n/texts";
import { saveFile } from "../../../ui/page/save-file";
import { undoHistory } from "../../../ui/page/undo-history";

export interface Draft {
  robotKey: string;
  /** The program's name, shown to all while it runs. */
  name: string;
  text: string;
  /** The version that it was opened from or saved as; null: it was never saved. */
  base: Base | null;
}

export interface Base {
  id: string;
  version: number;
  name: string;
  text: string;
}

interface Step {
  draft: Draft;
  cursor: number;
}

const STORAGE_PREFIX = "robomesh.program/";
export const FILE_ENDING = ".prog";
const MOST_STEPS = 200;
const TOGETHER_MS = 800; // text typed without a longer pause is one step
export const LINE_PX = 20;

export const draft = signal<Draft | null>(null);
/** The browser's message if it could not keep the draft; "" if it did. */
export const storageError = signal("");
const undoSteps = undoHistory<Step>(MOST_STEPS);
export const { canUndo, canRedo } = undoSteps;
/** Whether the draft differs from the version that it is based on. */
export const isUnsaved = computed(() => {
  const now = draft.value;
  return now !== null && (now.text !== (now.base?.text ?? "") || (now.base !== null && now.name !== now.base.name));
});

let field: HTMLTextAreaElement | null = null;
let typedAt = 0;

/** Open a robot's draft; false: it had none, and gets an empty one. */
export function openDraft(robotKey: string): boolean {
  const kept = storedDraft(robotKey);
  draft.value = kept ?? { robotKey, name: p("default_name"), text: "", base: null };
  undoSteps.clear();
  return kept !== null;
}

function storedDraft(robotKey: string): Draft | null {
  try {
    const { name, text, base } = JSON.parse(
      localStorage.getItem(STORAGE_PREFIX + robotKey) ?? "null",
    ) as Partial<Draft>;
    const isDraft = typeof name === "string" && typeof text === "string";
    return isDraft ? { robotKey, name, text, base: isBase(base) ? base : null } : null;
  } catch {
    return null; // none, or edited by hand
  }
}

function isBase(value: Partial<Base> | null | undefined): value is Base {
  const texts = [value?.id, value?.name, value?.text];
  return texts.every((each) => typeof each === "string") && typeof value?.version === "number";
}

effect(() => {
  const now = draft.value;
  // An empty draft is not kept: the example is for robots without a draft.
  if (!now?.text) return;
  try {
    localStorage.setItem(STORAGE_PREFIX + now.robotKey, JSON.stringify({ ...now, robotKey: undefined }));
    storageError.value = "";
  } catch (error) {
    storageError.value = String(error);
  }
});

/** The text field; null: unmounted. */
export function setField(element: HTMLTextAreaElement | null): void {
  field = element;
}

/** Record text that the operator typed into the field. */
export function recordTyping(): void {
  if (!field) return;
  const now = performance.now();
  changeText(field.value, now - typedAt < TOGETHER_MS);
  typedAt = now;
}

export function rename(name: string): void {
  if (draft.value) draft.value = { ...draft.value, name };
}

/** Start with a text: no undo, cursor unchanged. */
export function startDraft(text: string): void {
  if (field) field.value = text;
  if (draft.value) draft.value = { ...draft.value, text };
}

/** Replace the whole text as one undo step, and move the cursor to the end of a line. */
export function replace(text: string, line = 1): void {
  replaceDraft({ text }, line);
}

/** Replace parts of the draft as one undo step. */
export function replaceDraft(parts: Partial<Omit<Draft, "robotKey">>, line = 1): void {
  if (!field || !draft.value) return;
  const before = draft.value;
  const after = { ...before, ...parts };
  if (after.text !== before.text || after.name !== before.name || after.base !== before.base) change(after, false);
  typedAt = 0;
  show(after.text, after.text.split("\n").slice(0, line).join("\n").length);
}

/** Start a program that was never saved, as one undo step. */
export function startProgram(text: string, name: string): void {
  replaceDraft({ text, name, base: null });
}

/** Say which version the draft is based on from now on; no undo step. */
export function setBase(base: Base): void {
  if (draft.value) draft.value = { ...draft.value, name: base.name, base };
}

/** Insert a text at the cursor, replacing the selection. */
export function insert(text: string): void {
  if (!field) return;
  const { value, selectionStart, selectionEnd } = field;
  const before = value.slice(0, selectionStart) + text;
  changeText(before + value.slice(selectionEnd), false);
  show(before + value.slice(selectionEnd), before.length);
}

function changeText(text: string, together: boolean): void {
  if (draft.value && text !== draft.value.text) change({ ...draft.value, text }, together);
}

/** `together`: part of the previous step. */
function change(after: Draft, together: boolean): void {
  if (!draft.value) return;
  undoSteps.keep({ draft: draft.value, cursor: field?.selectionStart ?? 0 }, together && canUndo.value);
  draft.value = after;
}

export const undo = () => step(undoSteps.undo);
export const redo = () => step(undoSteps.redo);

function step(go: (now: Step) => Step | undefined): void {
  const after = field && draft.value && go({ draft: draft.value, cursor: field.selectionStart });
  if (!draft.value || !after) return;
  // A version that was saved since then stays saved.
  const saved = draft.value.base && draft.value.base.id === after.draft.base?.id ? draft.value.base : after.draft.base;
  draft.value = { ...after.draft, base: saved };
  typedAt = 0;
  show(after.draft.text, after.cursor);
}

function show(text: string, cursor: number): void {
  if (!field) return;
  field.value = text;
  field.focus({ preventScroll: true });
  field.setSelectionRange(cursor, cursor);
  requestAnimationFrame(() => scrollTo(cursorLine())); // once its lines are painted
}

/** Download a text as a file. */
export function download(text: string, name: string): void {
  saveFile(new Blob([text], { type: "text/plain" }), `${name.trim() || p("default_name")}${FILE_ENDING}`);
}

/** Return the line of the cursor, from 1. */
export function cursorLine(): number {
  if (!field) return 1;
  return field.value.slice(0, field.selectionEnd).split("\n").length;
}

/** Move the cursor to a line, and select it. */
export function goToLine(line: number): void {
  if (!field) return;
  const lines = field.value.split("\n");
  const start = lines.slice(0, line - 1).reduce((sum, each) => sum + each.length + 1, 0);
  field.focus({ preventScroll: true });
  field.setSelectionRange(start, start + (lines[line - 1]?.length ?? 0));
  scrollTo(line);
}

function scrollTo(line: number): void {
  const editor = field?.closest(".editor");
  if (!editor) return;
  editor.scrollIntoView({ block: "nearest" });
  const top = (line - 1) * LINE_PX;
  const room = editor.clientHeight - 3 * LINE_PX;
  editor.scrollTo({ left: 0, top: Math.min(Math.max(editor.scrollTop, top - room), top) });
}
