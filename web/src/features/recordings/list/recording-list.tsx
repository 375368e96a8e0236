// Every recording of every site, newest first.

import { signal } from "@preact/signals";
import { useEffect, useState } from "preact/hooks";
import { robotsOf, sizeText, startMs } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { Action, askRecorder } from "../../../mesh/services/recorder";
import { fleetRobots } from "../../../mesh/state/known-robots";
import { Button } from "../../../ui/inputs/button";
import { Select } from "../../../ui/inputs/select";
import { TextInput } from "../../../ui/inputs/text-input";
import { Warning } from "../../../ui/marks/warning";
import type { RecordingName } from "../../../ui/page/route";
import { NoticeLine } from "../../../ui/panel/notice-line";
import { useOutcome } from "../../../ui/panel/outcome";
import { BulkDownload, rowKey } from "./bulk-download";
import { RecordingCard } from "./recording-card";
import type { Row, SiteAnswer } from "./recordings-of-sites";
import { useRecordings } from "./recordings-of-sites";
import "./recording-list.css";

const HOUR_MS = 3_600_000;
const SPANS = { any_time: Infinity, today: 24 * HOUR_MS, week: 168 * HOUR_MS } as const;
type Span = keyof typeof SPANS;
const LOW_BYTES = 2_000_000_000;
const FULL_BYTES = 2_000_000; // with less space nothing can be written
const EVERY = "";

const search = signal("");
const tag = signal(EVERY);
const chosen = signal<ReadonlySet<string>>(new Set());
const robot = signal(EVERY);
const span = signal<Span>("any_time");
/** The first of two to compare; null: none is chosen. */
const first = signal<(RecordingName & { name: string }) | null>(null);

export function RecordingList() {
  const { rows, sites, waiting } = useRecordings();
  const robots = [...new Set(rows.flatMap(({ recording }) => robotsOf(recording)))].sort();
  const tags = [...new Set(rows.flatMap(({ recording }) => recording.tags))].sort();
  const shown = rows.filter(isWanted);
  useEffect(() => () => void (first.value = null), []);
  return (
    <div class="recordings">
      <div class="fleet-head row wrap gap-16">
        <h1>{r("recordings")}</h1>
        <span class="dim">{countText(shown.length, rows.length)}</span>
        <div class="recordings-filters flex narrow push gap-8">
          <TextInput
            type="search"
            placeholder={r("search_short")}
            aria-label={r("search")}
            value={search.value}
            set={(text) => (search.value = text)}
          />
          <Select
            label={r("robot")}
            value={robot.value}
            values={[EVERY, ...robots]}
            text={(name) => name || r("all_robots")}
            choose={(name) => (robot.value = name)}
          />
          {(tags.length > 0 || tag.value !== EVERY) && (
            <Select
              label={r("tag")}
              value={tag.value}
              values={[EVERY, ...new Set([...tags, tag.value].filter(Boolean))]}
              text={(name) => name || r("every_tag")}
              choose={(name) => (tag.value = name)}
            />
          )}
          <Select
            label={r("time")}
            value={span.value}
            values={Object.keys(SPANS) as Span[]}
            text={r}
            choose={(name) => (span.value = name)}
          />
        </div>
      </div>
      {[...sites].map(([site, answer]) => (
        <SiteLine key={site} site={site} answer={answer} named={sites.size > 1} />
      ))}
      {first.value && (
        <p class="compare-line row spread gap-16 pad-8-16" role="status">
          <span>{r("compare_second", { name: first.value.name })}</span>
          <Button text={r("cancel")} onClick={() => (first.value = null)} />
        </p>
      )}
      <BulkDownload rows={rows} shown={shown} chosen={chosen} />
      {waiting && rows.length === 0 ? (
        <Skeleton />
      ) : (
        <ol class="grid gap-8" aria-label={r("recordings")}>
          {shown.map((row) => (
            <RecordingCard key={rowKey(row)} row={row} sited={sites.size > 1} first={first} chosen={chosen} />
          ))}
        </ol>
      )}
      {!waiting && shown.length === 0 && <p class="empty">{r(rows.length ? "no_match" : "none")}</p>}
    </div>
  );
}

function isWanted({ recording }: Row): boolean {
  const searchText = search.value.trim().toLowerCase();
  const words = [
    ...robotsOf(recording),
    recording.name,
    recording.file,
    recording.cause,
    recording.note,
    ...recording.tags,
  ]
    .join(" ")
    .toLowerCase();
  return (
    (tag.value === EVERY || recording.tags.includes(tag.value)) &&
    (robot.value === EVERY || robotsOf(recording).includes(robot.value)) &&
    Date.now() - startMs(recording) <= SPANS[span.value] &&
    words.includes(searchText)
  );
}

function countText(shown: number, count: number): string {
  if (shown < count) return r("shown_of", { shown, count });
  return count === 1 ? r("count_one") : r("count", { count });
}

/** State of a site's recorder: free space, flight recorder, problems. */
function SiteLine({ site, answer: { list, problem }, named }: { site: string; answer: SiteAnswer; named: boolean }) {
  const { notice, isBusy, perform } = useOutcome((text) => r("not_saved", { text }));
  const [of, setOf] = useState("");
  const robots = fleetRobots.value
    .filter((key) => key.startsWith(`robomesh/${site}/`))
    .map((key) => key.split("/")[2] ?? "");
  const chosen = robots.includes(of) ? of : (robots[0] ?? "");
  const save = () =>
    perform(r("saving", { robot: chosen }), async () => {
      const { name } = await askRecorder(`robomesh/${site}/${chosen}`, Action.SAVE);
      return r("saved", { robot: chosen, name });
    });
  const free = list?.freeBytes ?? 0n;
  const low = free < LOW_BYTES;
  const full = free < FULL_BYTES;
  return (
    <div class="recorder-line row wrap pad-8-0">
      {named && <strong>{site}</strong>}
      {list && (
        <>
          <span class={full ? "state alarm" : low ? "state warning" : "dim"}>
            {low && <span class={`shape ${full ? "alarm" : "warning"}`} aria-hidden="true" />}
            {r(full ? "free_none" : low ? "free_low" : "free", { size: sizeText(free) })}
          </span>
          {list.flight && full ? (
            <span class="state alarm">{r("flight_full")}</span>
          ) : (
            <span class="dim" title={r(list.flight ? "flight_on_hint" : "flight_off_hint")}>
              {r(list.flight ? "flight_on" : "flight_off")}
            </span>
          )}
          {list.flight && chosen && (
            <span class="flex gap-8">
              {robots.length > 1 && (
                <Select label={r("robot")} value={chosen} values={robots} text={String} choose={setOf} />
              )}
              <Button
                text={robots.length > 1 ? r("save_last") : r("save_of", { robot: chosen })}
                disabled={isBusy}
                onClick={() => void save()}
              />
            </span>
          )}
        </>
      )}
      {problem && <Warning as="span" class="state warning" role="status" text={problem} />}
      {notice && <NoticeLine notice={notice} />}
    </div>
  );
}

function Skeleton() {
  return (
    <ol class="grid gap-8" aria-hidden="true">
      {[0, 1, 2].map((each) => (
        <li key={each} class="recording grid card gap-16">
          <span class="thumbnail" />
          <div class="recording-body narrow pad-8-0">
            <p class="skeleton">{"\u00a0"}</p>
            <p class="skeleton">{"\u00a0"}</p>
          </div>
        </li>
      ))}
    </ol>
  );
}
