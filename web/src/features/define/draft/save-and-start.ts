// Save, download and start, and their outcome.

import { signal } from "@preact/signals";
import { defineText as d } from "../../../i18n/texts";
import { reasonOf } from "../../../mesh/console/connection";
import { RefusedRequest } from "../../../mesh/console/refusal";
import { saveFile } from "../../../ui/page/save-file";
import { checked, invalidNumbers } from "./checks";
import { draft, identity, isOpen, isUnsaved, markSaved, parsePath } from "./draft";
import { openField } from "./selection";
import type { Robots } from "./server-requests";
import * as server from "./server-requests";

export type Outcome =
  | { kind: "done" | "refused"; text: string }
  | { kind: "exists"; text: string; name: string; thenStart: boolean }
  | { kind: "started"; site: string; robot: string };

/** Outcome of the last action; null: dismissed. */
export const outcome = signal<Outcome | null>(null);
/** The action in progress; "": none. */
export const busy = signal("");
export const knownRobots = signal<Robots | null>(null);

export async function listRobots(): Promise<void> {
  try {
    knownRobots.value = await server.robots();
  } catch (error) {
    outcome.value = { kind: "refused", text: d("not_done", { text: reasonOf(error) }) };
  }
}

async function perform<T>(what: string, work: () => Promise<T>): Promise<T | undefined> {
  if (busy.value) return undefined;
  busy.value = what;
  outcome.value = null;
  try {
    return await work();
  } catch (error) {
    outcome.value = { kind: "refused", text: d("not_done", { text: reasonOf(error) }) };
    return undefined;
  } finally {
    busy.value = "";
  }
}

/** Save the draft at the site, and start it on request.
 *
 * @param over The robot that the user agreed to overwrite; "": none.
 * @returns Whether it is saved. */
export async function save(thenStart: boolean, over = ""): Promise<boolean> {
  const now = draft.value;
  const of = identity.value;
  if (!now) return false;
  const { name } = now.description;
  const [typed] = invalidNumbers.value.keys();
  if (typed !== undefined) {
    outcome.value = { kind: "refused", text: d("mend_first") };
    openField(parsePath(typed));
    return false;
  }
  if (over !== name && knownRobots.value?.robots.some((robot) => robot.name === name && robot.running)) {
    outcome.value = { kind: "exists", text: d("exists_running", { name }), name, thenStart };
    return false;
  }
  // No question is needed while the site's copy is the one opened here.
  const revision = of.siteName === name ? of.revision : "";
  const done = await perform(d("saving"), async () => {
    try {
      return await server.save(now, revision, over !== "" && over === name);
    } catch (error) {
      if (!(error instanceof RefusedRequest) || !isOpen(of)) throw error;
      if (error.status === 409) {
        const text = d("exists", { text: error.message });
        outcome.value = { kind: "exists", text, name, thenStart };
        return undefined;
      }
      const problems = server.problemsOf(error);
      if (problems.length === 0) throw error;
      checked.value = { tool: null, ...checked.value, problems };
      outcome.value = { kind: "refused", text: d("mend_first") };
      openField(problems[0]?.path ?? []);
      return undefined;
    }
  });
  if (!done) return false;
  markSaved(now, of, done.name, done.revision);
  if (isOpen(of)) history.replaceState(null, "", `#/define/${encodeURIComponent(done.name)}`);
  outcome.value = { kind: "done", text: d("saved", { name: done.name, folder: done.folder }) };
  await listRobots();
  if (thenStart && isOpen(of)) await start();
  return true;
}

export async function download(): Promise<void> {
  const now = draft.value;
  if (!now) return;
  const archive = await perform(d("download"), () => server.zip(now));
  if (!archive) return;
  saveFile(archive, `${now.description.name || "robot"}.zip`);
}

export async function start(): Promise<void> {
  const { siteName } = identity.value;
  if (isUnsaved.value || !siteName) {
    await save(true);
    return;
  }
  const started = await perform(d("starting"), () => server.start(siteName));
  if (started) outcome.value = { kind: "started", ...started };
  await listRobots();
}

export async function stop(): Promise<void> {
  const name = identity.value.siteName;
  if (await perform(d("stop_simulated"), () => server.stop(name))) {
    outcome.value = { kind: "done", text: d("stopped", { name }) };
  }
  await listRobots();
}

export function isRunning(): boolean {
  return knownRobots.value?.robots.some(({ name, running }) => running && name === identity.value.siteName) ?? false;
}
