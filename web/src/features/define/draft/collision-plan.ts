// How each pair of the draft's links is checked, computed by the server as by `robomesh robot check`.

import { computed, effect, signal } from "@preact/signals";
import { reasonOf } from "../../../mesh/console/connection";
import { concise, linkNames } from "../description/description";
import type { Draft } from "./draft";
import { draft, identity, isOpen } from "./draft";
import type { Pair, PairKind } from "./server-requests";
import { collisions } from "./server-requests";

type Links = readonly [string, string];

export interface PairRow extends Omit<Pair, "links"> {
  links: Links;
  isIgnored: boolean;
  /** Ignored by a rule: the user's choice would change nothing. */
  isAutomatic: boolean;
}

const AFTER_MS = 600;
// Pairs that need attention come first.
const ORDER: readonly PairKind[] = [
  "touching",
  "no_surface",
  "not_studied",
  "collision_meshes",
  "visual_meshes",
  "false_contacts",
  "too_large",
  "description",
  "always",
  "adjacent",
  "apart",
];
const IGNORED: readonly PairKind[] = ["adjacent", "description", "always"];
const TOUCHING: readonly PairKind[] = ["touching", "no_surface", "not_studied"];

/** The last plan, its inputs, and its draft. */
const plan = signal<{ subject: string; id: string; pairs: readonly Pair[] } | null>(null);
const failure = signal<{ subject: string; text: string } | null>(null);
/** The draft whose plan is being computed; "": none. */
const working = signal("");

/** All inputs of a plan. */
const subject = computed(() => (draft.value ? subjectOf(draft.value) : ""));

export const planning = computed(() => working.value === identity.value.id);
/** Whether the plan is of the current draft. */
export const isPlanned = computed(() => plan.value?.subject === subject.value);
/** Why there is no plan; "" unless it failed. */
export const planError = computed(() => (failure.value?.subject === subject.value ? failure.value.text : ""));

function subjectOf({ description, files }: Draft): string {
  const unseen = { name: "", title: "", provenance: "", frame: [], view: {}, collision: { ignore: [] } };
  return JSON.stringify([concise({ ...description, ...unseen }), files]);
}

export const isSame = (one: Links, other: Links) => one.every((link) => other.includes(link));

/** Return all pairs of links with shapes, and other pairs that the user ignores. */
export const pairRows = computed<readonly PairRow[]>(() => {
  const description = draft.value?.description;
  if (!description) return [];
  const { ignore } = description.collision;
  const links = linkNames(description);
  const planned = plan.value?.id === identity.value.id ? plan.value.pairs : [];
  const known = planned.filter((pair) => pair.links.every((link) => links.includes(link)));
  return [
    ...known.map((pair) => (isSaid(pair, ignore) ? said(pair.links) : row(pair))),
    ...ignore.filter((pair) => !known.some((each) => isSame(each.links, pair))).map(said),
  ];
});

/** Return whether the user's choice matters: links one joint apart are always ignored. */
function isSaid({ links, kind }: Pair, ignore: readonly Links[]): boolean {
  return kind !== "adjacent" && ignore.some((each) => isSame(each, links));
}

function said(links: Links): PairRow {
  return { links, kind: "description", values: {}, isIgnored: true, isAutomatic: false };
}

function row(pair: Pair): PairRow {
  const isIgnored = IGNORED.includes(pair.kind);
  return { ...pair, isIgnored, isAutomatic: isIgnored };
}

export function isTouching({ kind }: PairRow): boolean {
  return TOUCHING.includes(kind);
}

/** Compute the plan of each change of the draft until the returned function is called. */
export function startPlanning(): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  const end = effect(() => {
    clearTimeout(timer);
    if (!subject.value || planning.value || isPlanned.value || planError.value) return;
    timer = setTimeout(() => void work(), plan.peek()?.id === identity.value.id ? AFTER_MS : 0);
  });
  return () => {
    end();
    clearTimeout(timer);
  };
}

async function work(): Promise<void> {
  const now = draft.peek();
  if (!now) return;
  const of = identity.peek();
  const own = subjectOf(now);
  const { ignore } = now.description.collision;
  // Sort once, so that rows stay in place while the user changes them.
  const rank = (pair: Pair) => ORDER.indexOf(isSaid(pair, ignore) ? "description" : pair.kind);
  working.value = of.id;
  try {
    const { pairs } = await collisions(now);
    if (isOpen(of))
      plan.value = { subject: own, id: of.id, pairs: pairs.sort((one, other) => rank(one) - rank(other)) };
  } catch (error) {
    if (isOpen(of)) failure.value = { subject: own, text: reasonOf(error) };
  }
  if (working.value === of.id) working.value = "";
}

export function planAgain(): void {
  failure.value = null;
}
