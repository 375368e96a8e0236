// Opening of a robot to define: as saved, or its unsaved draft.

import { signal } from "@preact/signals";
import { defineText as d } from "../../../i18n/texts";
import { reasonOf } from "../../../mesh/console/connection";
import { complete } from "../description/description";
import { closeDraft, deleteDraft, identity, isOpen, openDraft, restoreDraft } from "../draft/draft";
import { knownRobots, listRobots, outcome } from "../draft/save-and-start";
import { resetSelection } from "../draft/selection";
import { robot } from "../draft/server-requests";
import { fileNotices, waitingUrdf } from "./dropped-files";

/** What is being opened; "": nothing. */
export const loading = signal("");

/** Open a robot, or its unsaved draft; "": a new one's. */
export async function openRobot(name: string): Promise<void> {
  closeDraft();
  resetSelection();
  outcome.value = null;
  fileNotices.value = [];
  waitingUrdf.value = null;
  loading.value = "";
  if (restoreDraft(name) || !name) return;
  const place = identity.value;
  loading.value = d("loading");
  try {
    await listRobots();
    const origin = knownRobots.value?.robots.find((each) => each.name === name)?.origin ?? "site";
    const { description, files, notes, revision } = await robot(name);
    if (!isOpen(place)) return;
    const read = complete(description);
    // Library robots are read-only: a draft of one is another robot.
    if (origin === "library") read.name = `${name}-copy`;
    openDraft({ description: read, files }, name, origin, revision);
    fileNotices.value = notes.map((text) => ({ kind: "done", text }));
  } catch (error) {
    if (!isOpen(place)) return;
    const text = reasonOf(error);
    outcome.value = { kind: "refused", text: d("not_loaded", { name, text }) };
  } finally {
    if (isOpen(place)) loading.value = "";
  }
}

/** Discard the draft: reload the saved robot; a new one is deleted. */
export function discardDraft(): void {
  const { owner } = identity.value;
  deleteDraft();
  void openRobot(owner);
}
