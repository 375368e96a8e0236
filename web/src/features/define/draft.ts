// The draft: what is being defined, its undo and redo, and how it outlives a reload.

import { batch, computed, effect, signal } from "@preact/signals";
import type { Description } from "./description";

/** What a change changes, and an undo brings back. */
export interface Draft {
  description: Description;
  /** SHA-256 of every file of the description's folder, by path. */
  files: Record<string, string>;
}

/** Which draft it is, and what the site has of it. */
export interface Identity {
  /** Of the draft, or of the page before there is one: what was begun under another does not end here. */
  id: string;
  /** The robot that it is of; "": a new one. */
  owner: string;
  /** The name under which the site has it; "": it has not. */
  siteName: string;
  /** The draft as it was last saved, as text; "": never. */
  saved: string;
  /** Of the site's robot as it was opened, or last saved from here; "": none. */
  revision: string;
}

interface Kept {
  draft: Draft;
  identity: Identity;
  /** Last change, ms since the Unix epoch. */
  at: number;
}

const KEPT = "robomesh.define.draft/";
const NEW = `${KEPT}new/`; // no robot's name holds a slash
/** In the tab's own storage: the id of its new draft. */
const OF_THIS_TAB = "robomesh.define.new";
const MOST_STEPS = 500;

export const draft = signal<Draft | null>(null);
export const identity = signal<Identity>(newIdentity());
const past = signal<readonly Draft[]>([]);
const future = signal<readonly Draft[]>([]);
/** When the draft that a reload brought back was last changed; null: nothing was brought back. */
export const broughtBack = signal<number | null>(null);
let together = "";

export const canUndo = computed(() => past.value.length > 0);
export const canRedo = computed(() => future.value.length > 0);
export const isUnsaved = computed(() => draft.value !== null && textOf(draft.value) !== identity.value.saved);

function newIdentity(): Identity {
  const id = Date.now().toString(36) + Math.random().toString(36).slice(2);
  return { id, owner: "", siteName: "", saved: "", revision: "" };
}

/** Whether a draft, or the page before it, is still on the screen. */
export function isOpen({ id }: Identity): boolean {
  return identity.value.id === id;
}

function textOf(of: Draft): string {
  return JSON.stringify([of.description, of.files]);
}

/** Changes the draft: one step of undo, or, with the same `as` as just before, part of that step. */
export function edit(change: (draft: Draft) => void, as = ""): void {
  const before = draft.value;
  if (!before) return;
  const after = structuredClone(before);
  change(after);
  if (textOf(after) === textOf(before)) return;
  if (!as || as !== together) past.value = [...past.value, before].slice(-MOST_STEPS);
  together = as;
  future.value = [];
  draft.value = after;
}

/** Ends a step: a field was left, a drag let go. */
export function seal(): void {
  together = "";
}

export function undo(): void {
  step(past, future);
}

export function redo(): void {
  step(future, past);
}

function step(from: typeof past, to: typeof past): void {
  const before = draft.value;
  const after = from.value.at(-1);
  if (!before || !after) return;
  seal();
  from.value = from.value.slice(0, -1);
  to.value = [...to.value, before];
  draft.value = after;
}

/** Begins with a draft.
 *
 * @param owner The robot that it is of; "": a new one.
 * @param origin Where that robot is saved; a new one's draft is unsaved from the start.
 * @param revision Of that robot, as the site told it. */
export function begin(with_: Draft, owner = "", origin: "library" | "site" | null = null, revision = ""): void {
  const fresh = newIdentity();
  show(with_, {
    // What was dropped on the page before there was a draft is the draft's.
    id: draft.value ? fresh.id : identity.value.id,
    owner,
    saved: origin ? textOf(with_) : "",
    siteName: origin === "site" ? owner : "",
    revision: origin === "site" ? revision : "",
  });
}

function show(shown: Draft, of: Identity, at: number | null = null): void {
  batch(() => {
    seal();
    past.value = [];
    future.value = [];
    broughtBack.value = at;
    identity.value = of;
    draft.value = shown;
  });
}

/** A draft was saved under a name: it is that robot's from now on, where it is still open. */
export function savedAs(as: Draft, of: Identity, name: string, revision: string): void {
  const key = keyOf(of);
  const kept = keptAt(key);
  if (isOpen(of) || (kept && textOf(kept.draft) === textOf(as))) localStorage.removeItem(key);
  if (isOpen(of)) broughtBack.value = null;
  if (isOpen(of)) identity.value = { id: of.id, owner: name, siteName: name, saved: textOf(as), revision };
}

/** Ends the draft without keeping it. */
export function discard(): void {
  localStorage.removeItem(keyOf(identity.value));
  leave();
}

/** Leaves the draft, which stays kept. */
export function leave(): void {
  batch(() => {
    draft.value = null;
    broughtBack.value = null;
    identity.value = newIdentity();
  });
}

/** Leaves the draft for a new one: it is offered, but not brought back by itself. */
export function putAside(): void {
  sessionStorage.removeItem(OF_THIS_TAB);
  leave();
}

/** Brings back an unsaved draft; false: there is none.
 *
 * @param owner The robot that it is of; "": a new one.
 * @param id Which new one; this tab's, where it is left out. */
export function bringBack(owner: string, id = sessionStorage.getItem(OF_THIS_TAB) ?? ""): boolean {
  const kept = keptAt(keyOf({ owner, id }));
  if (kept) show(kept.draft, kept.identity, kept.at);
  return kept !== null;
}

/** Whether a robot has an unsaved draft. */
export function hasKept(owner: string): boolean {
  return keptAt(keyOf({ owner, id: "" })) !== null;
}

/** Unsaved new drafts of every tab, the last changed first. */
export function newDrafts(): { id: string; name: string; at: number }[] {
  const kept = keys(NEW).flatMap((key) => keptAt(key) ?? []);
  return kept
    .map(({ draft: { description }, identity: { id }, at }) => ({
      id,
      name: description.title || description.name,
      at,
    }))
    .sort((one, other) => other.at - one.at);
}

/** SHA-256 of every file that some kept draft holds. */
export function keptFiles(): Set<string> {
  return new Set(keys(KEPT).flatMap((key) => Object.values(keptAt(key)?.draft.files ?? {})));
}

function keys(start: string): string[] {
  return Object.keys(localStorage).filter((key) => key.startsWith(start));
}

function keyOf({ owner, id }: Pick<Identity, "owner" | "id">): string {
  return owner ? KEPT + owner : NEW + id;
}

function keptAt(key: string): Kept | null {
  try {
    const kept = JSON.parse(localStorage.getItem(key) ?? "null") as Kept | null;
    return kept?.identity && Array.isArray(kept.draft.description.joint) ? kept : null;
  } catch {
    return null; // written by another version, or by hand
  }
}

/** What could not be kept for a reload, in the browser's words; "" when all is well. */
export const keepingFailed = signal("");

effect(() => {
  const now = draft.value;
  const of = identity.value;
  if (!now) return;
  const key = keyOf(of);
  if (!isUnsaved.value) {
    localStorage.removeItem(key);
    return;
  }
  const kept: Kept = { draft: now, identity: of, at: Date.now() };
  const before = keptAt(key);
  if (before && JSON.stringify({ ...before, at: 0 }) === JSON.stringify({ ...kept, at: 0 })) return; // brought back
  try {
    localStorage.setItem(key, JSON.stringify(kept));
    keepingFailed.value = "";
  } catch (error) {
    keepingFailed.value = String(error);
  }
});

effect(() => {
  const { owner, id } = identity.value;
  if (draft.value && !owner) sessionStorage.setItem(OF_THIS_TAB, id);
});
