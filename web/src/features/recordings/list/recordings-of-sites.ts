// The recordings of every site, from its recorder, with the published state of open ones.

import { EmptySchema } from "@bufbuild/protobuf/wkt";
import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import type { Recording, RecordingList } from "../../../gen/robomesh_pb";
import { RecordingListSchema, RecordingSchema } from "../../../gen/robomesh_pb";
import { startMs } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { AskError, ask, hello, lostAt, presence, reasonOf } from "../../../mesh/console/connection";
import { ageOf, isStale } from "../../../mesh/state/staleness";
import { useTopics } from "../../../mesh/state/topics";

const REFRESH_INTERVAL_MS = 5000;
const TIMEOUT_S = 10;

/** The last answer of a site's recorder. */
export interface SiteAnswer {
  list: RecordingList | null;
  problem: string;
}
const answers = signal<ReadonlyMap<string, SiteAnswer>>(new Map());

/** Sites with a recorder, and the console's own site. */
function sitesOf(keys: ReadonlySet<string>, own: string): readonly string[] {
  const sites = new Set(own ? [own] : []);
  for (const key of keys) {
    const [, site, , , service] = key.split("/");
    if (site && service === "recorder") sites.add(site);
  }
  return [...sites].sort();
}

async function requestList(site: string): Promise<void> {
  let now: SiteAnswer;
  try {
    const key = `robomesh/${site}/-/recordings/list`;
    now = { list: await ask(key, EmptySchema, {}, RecordingListSchema, TIMEOUT_S), problem: "" };
  } catch (error) {
    const silent = error instanceof AskError && error.noAnswer;
    const text = reasonOf(error);
    const problem = silent ? r("no_recorder", { site }) : r("list_refused", { site, text });
    now = { list: answers.value.get(site)?.list ?? null, problem };
  }
  answers.value = new Map(answers.value).set(site, now);
}

/** Request a site's list again, after a change of its recordings. */
export function refreshSite(site: string): void {
  void requestList(site);
}

/** A recording in the list with its site: file names are unique only within a site. */
export interface Row {
  site: string;
  recording: Recording;
}

export interface RecordingsOfSites {
  sites: ReadonlyMap<string, SiteAnswer>;
  /** Newest first. */
  rows: readonly Row[];
  /** No answer yet. */
  waiting: boolean;
}

/** Every recording of every site; open ones with their current state. */
export function useRecordings(): RecordingsOfSites {
  const live = useTopics(RecordingSchema, "robomesh/*/*/recording");
  const sites = sitesOf(presence.value, hello.value?.site ?? "");
  // A recording that started or ended changes the list.
  const changes = [...live.values()].map(({ message }) => `${message.file}:${message.open}`).join(" ");
  const connected = lostAt.value === null;
  useEffect(() => {
    if (!connected) return;
    const requestLists = () => sites.forEach((site) => void requestList(site));
    requestLists();
    const timer = setInterval(() => document.hidden || requestLists(), REFRESH_INTERVAL_MS);
    return () => clearInterval(timer);
  }, [sites.join(" "), changes, connected]);
  const rows = new Map<string, Row>();
  for (const site of sites) {
    for (const recording of answers.value.get(site)?.list?.recordings ?? [])
      rows.set(`${site}/${recording.file}`, { site, recording });
  }
  for (const latest of live.values()) {
    const [, site = ""] = latest.key.split("/");
    // A name that was just changed is in the list before the next heartbeat.
    const listed = rows.get(`${site}/${latest.message.file}`)?.recording;
    if (listed && listed.changes > latest.message.changes && listed.open) continue;
    if (latest.message.open && !isStale("recording", ageOf(latest))) {
      rows.set(`${site}/${latest.message.file}`, { site, recording: latest.message });
    }
  }
  return {
    sites: new Map(sites.map((site) => [site, answers.value.get(site) ?? { list: null, problem: "" }])),
    rows: [...rows.values()].sort((first, second) => startMs(second.recording) - startMs(first.recording)),
    waiting: sites.some((site) => !answers.value.has(site)) || sites.length === 0,
  };
}
