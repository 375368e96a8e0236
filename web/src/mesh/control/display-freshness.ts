// What this page shows of each robot: the age of its state, and its pictures.
//
// An operator moves a robot by what the page shows. So no new motion starts from an old picture or state, and
// each command reports what was on the screen.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { useEffect, useMemo } from "preact/hooks";
import type { ControllerState, PageReportSchema } from "../../gen/robomesh_pb";
import { ageText } from "../../i18n/format";
import { t, viewText } from "../../i18n/texts";
import { ageClock } from "../console/age-clock";
import type { Sample } from "../console/connection";
import { isStale, jointsAge } from "../state/staleness";
import type { Latest } from "../state/topics";

/** The page's own drawing, among the names of views. */
export const OWN_DRAWING = "3d";

/** A publication that is on the screen; null: its number is not known, as of a stored picture. */
export type Picture = Pick<Sample, "sequence" | "sourceTime" | "newAt"> | null;

/** A place of the page that shows pictures of a robot. */
interface ShownView {
  view: string;
  /** Of its pictures, as in the table of topics. */
  topic: string;
  element: () => Element | null;
  /** The newest drawn picture; undefined: none yet. */
  picture: Picture | undefined;
}

const views = new Map<string, Set<ShownView>>();
const states = new Map<string, (at: number) => number | null>();

/** Register the robot's state that a page shows. */
export function useShownState(
  robotKey: string,
  joints: Latest<unknown> | undefined,
  controller: Latest<ControllerState> | undefined,
): void {
  useEffect(() => void states.set(robotKey, (at) => jointsAge(joints, controller, at)), [robotKey, joints, controller]);
  useEffect(() => () => void states.delete(robotKey), [robotKey]);
}

/** Register a place for pictures; set its `picture` whenever one is drawn. */
export function useShownView(
  robotKey: string,
  view: string,
  topic: string,
  element: () => Element | null,
): { picture: Picture | undefined } {
  const shown = useMemo<ShownView>(() => ({ view, topic, element, picture: undefined }), [robotKey, view, topic]);
  shown.element = element;
  useEffect(() => {
    const ofRobot = views.get(robotKey) ?? new Set();
    views.set(robotKey, ofRobot.add(shown));
    return () => {
      ofRobot.delete(shown);
      if (ofRobot.size === 0) views.delete(robotKey);
    };
  }, [shown]);
  return shown;
}

/** Return why no new motion may start: the state, or a picture on the screen, is old; empty: none is. */
export function whyFrozen(robotKey: string, at = ageClock()): string {
  const why = frozenCause(robotKey, at);
  return why && t("frozen", { why });
}

/** Return which part of the picture is old, and how old; empty: none. */
export function frozenCause(robotKey: string, at = ageClock()): string {
  const state = states.get(robotKey)?.(at);
  if (state !== undefined && isStale("joints", state)) return frozenText(t("frozen_state"), state);
  for (const shown of views.get(robotKey) ?? []) {
    const age = pictureAge(shown, at);
    if (age === undefined || !isStale(shown.topic, age) || !isOnScreen(shown)) continue;
    const isDrawing = shown.view === OWN_DRAWING;
    return frozenText(isDrawing ? t("frozen_drawing") : t("frozen_video", { view: viewText(shown.view) }), age);
  }
  return "";
}

function frozenText(what: string, age: number | null): string {
  return age === null ? t("frozen_not_live", { what }) : t("frozen_old", { what, age: ageText(age) });
}

/** Return whether a dialog is before the page. */
export const dialogIsOpen = () => document.querySelector("dialog[open]") !== null;

/** Return what the page shows of a robot now, for the audit log; undefined: nothing. */
export function pageReport(robotKey: string): MessageInitShape<typeof PageReportSchema> | undefined {
  const at = ageClock();
  const state = states.get(robotKey)?.(at) ?? null;
  const onScreen = [...(views.get(robotKey) ?? [])].filter((shown) => shown.picture !== undefined && isOnScreen(shown));
  // A rendered picture can be found again in a recording.
  const shown = onScreen.find(({ view }) => view !== OWN_DRAWING) ?? onScreen[0];
  if (!shown && state === null) return undefined;
  const age = shown && pictureAge(shown, at);
  return {
    view: shown?.view ?? "",
    ...(shown?.picture && {
      picture: shown.picture.sequence,
      pictureTime: stampOf(shown.picture.sourceTime),
    }),
    ...(typeof age === "number" && { pictureAgeS: age }),
    ...(state !== null && { stateAgeS: state }),
  };
}

/** Return the age [s] of the drawn picture; null: not known; undefined: no picture. */
function pictureAge({ picture }: ShownView, at: number): number | null | undefined {
  if (picture === undefined) return undefined;
  return picture?.newAt == null ? null : Math.max(0, (at - picture.newAt) / 1000);
}

function isOnScreen({ element }: ShownView): boolean {
  const shown = element();
  if (!shown?.checkVisibility()) return false;
  const { left, right, top, bottom } = shown.getBoundingClientRect();
  return right > 0 && bottom > 0 && left < innerWidth && top < innerHeight;
}

/** Return a time [ms] as seconds and nanoseconds, to the microsecond. */
function stampOf(ms: number): { seconds: bigint; nanos: number } {
  const seconds = Math.floor(ms / 1000);
  return { seconds: BigInt(seconds), nanos: Math.round((ms - seconds * 1000) * 1000) * 1000 };
}
