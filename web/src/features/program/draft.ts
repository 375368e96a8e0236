// The draft: one a robot, kept in the browser while it is typed, with its own undo and redo.
//
// The text field's undo takes seconds for a thousand lines, and loses what the page writes.

import { computed, effect, signal } from "@preact/signals";

export interface Draft {
  robotKey: string;
  /** The file's name, shown to all while the program runs. */
  name: string;
  text: string;
}

interface Step {
  text: string;
  cursor: number;
}

const STORAGE_PREFIX = "robomesh.program/";
const FIRST_NAME = "program";
export const FILE_ENDING = ".prog";
const MOST_STEPS = 200;
const TOGETHER_MS = 800; // text typed without a longer pause is one step
export const LINE_PX = 20;

export const draft = signal<Draft | null>(null);
/** The browser's message if it could not keep the draft; "" if it did. */
export const storageError = signal("");
const past = signal<readonly Step[]>([]);
const future = signal<readonly Step[]>([]);
export const canUndo = computed(() => past.value.length > 0);
export const canRedo = computed(() => future.value.length > 0);

let field: HTMLTextAreaElement | null = null;
let typedAt = 0;

/** Open a robot's draft; false: it had none, and gets an empty one. */
export function openDraft(robotKey: string): boolean {
  const kept = storedDraft(robotKey);
  draft.value = kept ?? { robotKey, name: FIRST_NAME, text: "" };
  past.value = future.value = [];
  return kept !== null;
}

function storedDraft(robotKey: string): Draft | null {
  try {
    const { name, text } = JSON.parse(localStorage.getItem(STORAGE_PREFIX + robotKey) ?? "null") as Partial<Draft>;
    return typeof name === "string" && typeof text === "string" ? { robotKey, name, text } : null;
  } catch {
    return null; // none, or edited by hand
  }
}

effect(() => {
  const now = draft.value;
  // An empty draft is not kept: the example is for robots without a draft.
  if (!now?.text) return;
  try {
    localStorage.setItem(STORAGE_PREFIX + now.robotKey, JSON.stringify({ name: now.name, text: now.text }));
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
  change(field.value, now - typedAt < TOGETHER_MS);
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
  if (!field) return;
  change(text, false);
  typedAt = 0;
  show({ text, cursor: text.split("\n").slice(0, line).join("\n").length });
}

/** Insert a text at the cursor, replacing the selection. */
export function insert(text: string): void {
  if (!field) return;
  const { value, selectionStart, selectionEnd } = field;
  const before = value.slice(0, selectionStart) + text;
  change(before + value.slice(selectionEnd), false);
  show({ text: before + value.slice(selectionEnd), cursor: before.length });
}

/** `together`: part of the previous step. */
function change(text: string, together: boolean): void {
  const before = draft.value;
  if (!before || text === before.text) return;
  if (!together || !canUndo.value) {
    past.value = [...past.value, { text: before.text, cursor: field?.selectionStart ?? 0 }].slice(-MOST_STEPS);
  }
  future.value = [];
  draft.value = { ...before, text };
}

export function undo(): void {
  step(past, future);
}

export function redo(): void {
  step(future, past);
}

function step(from: typeof past, to: typeof past): void {
  const after = from.value.at(-1);
  if (!field || !draft.value || !after) return;
  from.value = from.value.slice(0, -1);
  to.value = [...to.value, { text: draft.value.text, cursor: field.selectionStart }];
  draft.value = { ...draft.value, text: after.text };
  typedAt = 0;
  show(after);
}

function show({ text, cursor }: Step): void {
  if (!field) return;
  field.value = text;
  field.focus({ preventScroll: true });
  field.setSelectionRange(cursor, cursor);
  requestAnimationFrame(() => scrollTo(cursorLine())); // once its lines are painted
}

/** Save the draft as a file. */
export function download(): void {
  const now = draft.value;
  if (!now?.text) return;
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([now.text], { type: "text/plain" }));
  link.download = `${now.name.trim() || FIRST_NAME}${FILE_ENDING}`;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
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
