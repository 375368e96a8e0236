// Selection while a draft is edited: the chosen part, the open tab, the joint positions.

import { computed, signal } from "@preact/signals";
import type { Body, Description, Joint } from "../description/description";
import { linkName } from "../description/description";
import { draft } from "./draft";

/** The base, a joint with its link by index, or the tool. */
export type Part = "base" | "tool" | number;
export const TABS = ["details", "robot", "frames", "constraints", "collisions", "views"] as const;
export type Tab = (typeof TABS)[number];

export const chosenPart = signal<Part>("base");
export const tab = signal<Tab>("details");
/** Slider positions by joint name, in the description's units; missing joints are at home. */
export const sliderPositions = signal<ReadonlyMap<string, number>>(new Map());

export function choosePart(part: Part): void {
  chosenPart.value = part;
  tab.value = "details";
}

/** Reset for another robot. */
export function resetSelection(): void {
  chosenPart.value = "base";
  tab.value = "details";
  sliderPositions.value = new Map();
}

/** The chosen joint; undefined: none. */
export function chosenJoint(of: Description): Joint | undefined {
  return typeof chosenPart.value === "number" ? of.joint[chosenPart.value] : undefined;
}

/** Return a link's appearance; undefined: the tool has none. */
export function bodyOf(of: Description, part: Part): Body | undefined {
  return part === "base" ? of.base : typeof part === "number" ? of.joint[part]?.link : undefined;
}

export const chosenBody = (of: Description): Body | undefined => bodyOf(of, chosenPart.value);

export function chosenLinkName(of: Description): string {
  const joint = chosenJoint(of);
  return joint ? linkName(joint) : String(chosenPart.value);
}

export function positionOf(joint: Joint): number {
  const position = sliderPositions.value.get(joint.name) ?? joint.home;
  return Math.max(joint.limits[0], Math.min(joint.limits[1], position));
}

/** Positions of all joints, in the description's units. */
export const positions = computed<readonly number[]>(() => draft.value?.description.joint.map(positionOf) ?? []);

/** Open a problem's part and tab, and focus the nearest field. */
export function openField(path: readonly (string | number)[]): void {
  const [first, second] = path;
  const tabs: Record<string, Tab> = {
    frame: "frames",
    constraint: "constraints",
    collision: "collisions",
    view: "views",
  };
  if (first === "joint" && typeof second === "number") {
    choosePart(Math.min(second, (draft.value?.description.joint.length ?? 1) - 1));
  } else if (first === "base" || first === "tool") {
    choosePart(first);
  } else {
    tab.value = tabs[String(first)] ?? "robot";
  }
  requestAnimationFrame(() => requestAnimationFrame(() => focusNearest(path)));
}

function focusNearest(path: readonly (string | number)[]): void {
  for (let length = path.length; length > 0; length--) {
    const place = path.slice(0, length).join("/");
    const found = [...document.querySelectorAll<HTMLElement>("[data-path]")].find(({ dataset }) => {
      return dataset.path === place || dataset.path?.startsWith(`${place}/`);
    });
    if (found) {
      found.scrollIntoView({ block: "nearest" });
      found.focus();
      return;
    }
  }
}
