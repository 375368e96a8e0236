// The draft being defined, its undo and redo, and how it survives a reload.

import { batch, computed, effect, signal } from "@preact/signals";
import { undoHistory } from "../../../ui/page/undo-history";
import type { Description } from "../description/description";

/** The editable state, which undo restores. */
export interface Draft {
  description: Description;
  /** SHA-256 of every file of the description's folder, by path. */
  files: Record<string, string>;
}

/** The draft's identity, and its saved state at the site. */
export interface Identity {
  /** Signal of the draft, or of the page before it: tasks that began under another draft must not end in this one. */
  id: string;
  /** The robot that it belongs to; "": a new one. */
  owner: string;
  /** The name under which the site has saved it; "": not saved. */
  siteName: string;
  /** The draft as last saved, as text; "": never. */
  saved: string;
  /** Revision of the site's robot when it was opened or last saved here; "": none. */
  revision: string;
}

interface StoredDraft {
  draft: Draft;
  identity: Identity;
  /** Last change, ms since the Unix epoch. */
  at: number;
}

const STORAGE_PREFIX = "robomesh.define.draft/";
const NEW_PREFIX = `${STORAGE_PREFIX}new/`; // no robot's name contains a slash
/** Key in the tab's storage: the id of its new draft. */
const TAB_DRAFT_KEY = "robomesh.define.new";
const MAX_UNDO_STEPS = 500;

export const draft = signal<Draft | null>(null);
export const identity = signal<Identity>(newIdentity());
const undoSteps = undoHistory<Draft>(MAX_UNDO_STEPS);
export const { canUndo, canRedo } = undoSteps;
/** When the draft that a reload restored was last changed; null: none was restored. */
export const restoredFrom = signal<number | null>(null);
let undoGroup = "";

export const isUnsaved = computed(() => draft.value !== null && textOf(draft.value) !== identity.value.saved);

function newIdentity(): Identity {
  const id = Date.now().toString(36) + Math.random().toString(36).slice(2);
  return { id, owner: "", siteName: "", saved: "", revision: "" };
}

/** Return whether a draft, or the page before it, is still open. */
export function isOpen({ id }: Identity): boolean {
  return identity.value.id === id;
}

function textOf(of: Draft): string {
  return JSON.stringify([of.description, of.files]);
}

/** Change the draft: one undo step, or part of the previous step if `as` is the same. */
export function editDraft(change: (draft: Draft) => void, as = ""): void {
  const before = draft.value;
  if (!before) return;
  const after = structuredClone(before);
  change(after);
  if (textOf(after) === textOf(before)) return;
  undoSteps.keep(before, as !== "" && as === undoGroup);
  undoGroup = as;
  draft.value = after;
}

/** Return the steps of a path in a description, "joint/2/limits/0", as in the server's problems. */
export function parsePath(path: string): (string | number)[] {
  return path.split("/").map((step) => (/^\d+$/.test(step) ? Number(step) : step));
}

type Values = { [step: string | number]: unknown };

function parentOf(path: string, of: Description): [Values | undefined, string | number] {
  const steps = parsePath(path);
  const last = steps.pop() ?? "";
  const parent = steps.reduce<unknown>((at, step) => (at as Values | undefined)?.[step], of);
  return [parent as Values | undefined, last];
}

/** Return the description's value at a path; undefined: it has none. */
export function valueAt(path: string): unknown {
  if (!draft.value) return undefined;
  const [parent, last] = parentOf(path, draft.value.description);
  return parent?.[last];
}

/** Change the description's value at a path: one undo step with changes of the same path just before, or of its own. */
export function setValue(path: string, value: unknown, isOwnStep = false): void {
  const change = ({ description }: Draft) => {
    const [parent, last] = parentOf(path, description);
    if (parent) parent[last] = value;
  };
  editDraft(change, isOwnStep ? "" : path);
}

/** End an undo step: a field lost the focus, a drag ended. */
export function endUndoStep(): void {
  undoGroup = "";
}

export const undo = () => step(undoSteps.undo);
export const redo = () => step(undoSteps.redo);

function step(go: (now: Draft) => Draft | undefined): void {
  if (!draft.value) return;
  endUndoStep();
  draft.value = go(draft.value) ?? draft.value;
}

/** Open a draft.
 *
 * @param owner The robot that it belongs to; "": a new one.
 * @param origin Where that robot is saved; a new one's draft is unsaved from the start.
 * @param revision The robot's revision, from the site. */
export function openDraft(with_: Draft, owner = "", origin: "library" | "site" | null = null, revision = ""): void {
  const fresh = newIdentity();
  replaceDraft(with_, {
    // Files that were dropped before belong to this draft.
    id: draft.value ? fresh.id : identity.value.id,
    owner,
    saved: origin ? textOf(with_) : "",
    siteName: origin === "site" ? owner : "",
    revision: origin === "site" ? revision : "",
  });
}

function replaceDraft(shown: Draft, of: Identity, at: number | null = null): void {
  batch(() => {
    endUndoStep();
    undoSteps.clear();
    restoredFrom.value = at;
    identity.value = of;
    draft.value = shown;
  });
}

/** Mark a draft as saved under a name; if it is still open, it now belongs to that robot. */
export function markSaved(as: Draft, of: Identity, name: string, revision: string): void {
  const key = keyOf(of);
  const kept = storedAt(key);
  if (isOpen(of) || (kept && textOf(kept.draft) === textOf(as))) localStorage.removeItem(key);
  if (isOpen(of)) restoredFrom.value = null;
  if (isOpen(of)) identity.value = { id: of.id, owner: name, siteName: name, saved: textOf(as), revision };
}

/** Close the draft and delete it. */
export function deleteDraft(): void {
  localStorage.removeItem(keyOf(identity.value));
  closeDraft();
}

/** Close the draft, which stays kept. */
export function closeDraft(): void {
  batch(() => {
    draft.value = null;
    restoredFrom.value = null;
    identity.value = newIdentity();
  });
}

/** Close the draft for a new one: it stays in the list, but a reload does not restore it. */
export function startNewDraft(): void {
  sessionStorage.removeItem(TAB_DRAFT_KEY);
  closeDraft();
}

/** Restore an unsaved draft; false: there is none.
 *
 * @param owner The robot that it belongs to; "": a new one.
 * @param id Which new one; by default this tab's. */
export function restoreDraft(owner: string, id = sessionStorage.getItem(TAB_DRAFT_KEY) ?? ""): boolean {
  const kept = storedAt(keyOf({ owner, id }));
  if (kept) replaceDraft(kept.draft, kept.identity, kept.at);
  return kept !== null;
}

/** Return whether a robot has an unsaved draft. */
export function hasStoredDraft(owner: string): boolean {
  return storedAt(keyOf({ owner, id: "" })) !== null;
}

/** Unsaved new drafts of every tab, the last changed first. */
export function newDrafts(): { id: string; name: string; at: number }[] {
  const kept = keys(NEW_PREFIX).flatMap((key) => storedAt(key) ?? []);
  return kept
    .map(({ draft: { description }, identity: { id }, at }) => ({
      id,
      name: description.title || description.name,
      at,
    }))
    .sort((one, other) => other.at - one.at);
}

/** Return the SHA-256 of every file in any kept draft. */
export function storedFiles(): Set<string> {
  return new Set(keys(STORAGE_PREFIX).flatMap((key) => Object.values(storedAt(key)?.draft.files ?? {})));
}

function keys(start: string): string[] {
  return Object.keys(localStorage).filter((key) => key.startsWith(start));
}

function keyOf({ owner, id }: Pick<Identity, "owner" | "id">): string {
  return owner ? STORAGE_PREFIX + owner : NEW_PREFIX + id;
}

function storedAt(key: string): StoredDraft | null {
  try {
    const kept = JSON.parse(localStorage.getItem(key) ?? "null") as StoredDraft | null;
    return kept?.identity && Array.isArray(kept.draft.description.joint) ? kept : null;
  } catch {
    return null; // written by another version, or by hand
  }
}

/** The browser's message if the draft could not be kept; "" if it was. */
export const storageError = signal("");

effect(() => {
  const now = draft.value;
  const of = identity.value;
  if (!now) return;
  const key = keyOf(of);
  if (!isUnsaved.value) {
    localStorage.removeItem(key);
    return;
  }
  const kept: StoredDraft = { draft: now, identity: of, at: Date.now() };
  const before = storedAt(key);
  if (before && JSON.stringify({ ...before, at: 0 }) === JSON.stringify({ ...kept, at: 0 })) return; // restored
  try {
    localStorage.setItem(key, JSON.stringify(kept));
    storageError.value = "";
  } catch (error) {
    storageError.value = String(error);
  }
});

effect(() => {
  const { owner, id } = identity.value;
  if (draft.value && !owner) sessionStorage.setItem(TAB_DRAFT_KEY, id);
});
