// One recording in the list: thumbnail, contents, losses and actions.

import type { Signal } from "@preact/signals";
import { useState } from "preact/hooks";
import type { Recording } from "../../../gen/robomesh_pb";
import { count, timeText } from "../../../i18n/format";
import { reasonText } from "../../../i18n/reasons";
import {
  durationS,
  fileUrl,
  isEmpty,
  lostText,
  messagesOf,
  momentText,
  robotsOf,
  sizeText,
  startedText,
  startMs,
} from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { mayAct } from "../../../mesh/console/account";
import { Action, askRecorder } from "../../../mesh/services/recorder";
import { Button } from "../../../ui/inputs/button";
import { Silhouette } from "../../../ui/marks/silhouette";
import { Warning } from "../../../ui/marks/warning";
import type { RecordingName } from "../../../ui/page/route";
import { recordingsLink } from "../../../ui/page/route";
import { NoticeLine } from "../../../ui/panel/notice-line";
import { useOutcome } from "../../../ui/panel/outcome";
import { rowKey } from "./bulk-download";
import { RecordingEditor } from "./recording-editor";
import type { Row } from "./recordings-of-sites";
import { refreshSite } from "./recordings-of-sites";

export function RecordingCard(props: {
  row: Row;
  sited: boolean;
  first: Signal<(RecordingName & { name: string }) | null>;
  /** Keys of the rows that are chosen for a download. */
  chosen: Signal<ReadonlySet<string>>;
}) {
  const [editing, setEditing] = useState(false);
  const { recording, site } = props.row;
  const { file, open } = recording;
  const name = recording.name || file;
  const empty = isEmpty(recording);
  const mine = { site, file };
  const lost = lostText(recording);
  const robots = robotsOf(recording).join(", ");
  const first = props.first.value;
  const isFirst = first?.site === site && first.file === file;
  const compare = () => (props.first.value = isFirst ? null : { ...mine, name });
  return (
    <li class={`recording grid card gap-16 ${open ? "open" : ""}`}>
      <Thumbnail site={site} recording={recording} />
      <div class="recording-body narrow pad-8-0">
        <div class="recording-title row wrap">
          {!open && <Choose row={props.row} name={name} chosen={props.chosen} />}
          <strong class="large bold break" title={file}>
            {name}
          </strong>
          {open && (
            <span class="tag recording-now">
              <span class="record-dot" aria-hidden="true" />
              {r("recording_now")}
            </span>
          )}
          {recording.part > 0 && <span class="tag">{r("part", { part: recording.part })}</span>}
          {recording.mergedFrom.length > 0 && <span class="tag">{r("merged")}</span>}
          {recording.recovered && (
            <span class="tag" title={r("recovered_hint")}>
              {r("recovered")}
            </span>
          )}
        </div>
        <p class="recording-facts flex wrap gap-0-16 dim">
          <span>{props.sited ? `${site} / ${robots}` : robots}</span>
          <time>{timeText(startMs(recording))}</time>
          <span class="figure">{momentText(durationS(recording), 0)}</span>
          <span class="figure">{sizeText(recording.bytes)}</span>
          <span class="figure">{r("messages", { count: count(messagesOf(recording)) })}</span>
          <span>{startedText(recording)}</span>
        </p>
        {recording.tags.length > 0 && (
          <p class="flex wrap gap-4-8">
            {recording.tags.map((each) => (
              <span key={each} class="tag">
                {each}
              </span>
            ))}
          </p>
        )}
        {recording.note && <p class="recording-note">{recording.note}</p>}
        {recording.cause && <p class="recording-words break small">{r("cause", { text: recording.cause })}</p>}
        {(lost || recording.problem || empty) && (
          <Warning
            class="recording-words break small state warning"
            text={[reasonText(recording.problemReason, recording.problem) || (empty && r("nothing_written")), lost]
              .filter(Boolean)
              .join("; ")}
          />
        )}
      </div>
      <div class="recording-does flex gap-8">
        {open && mayAct.value && !isOfFlight(recording) && <Stop row={props.row} name={name} />}
        {!empty && (
          <>
            <a
              class={`action ${first ? "" : "primary"}`}
              href={recordingsLink(mine)}
              aria-label={r("play_of", { name })}
            >
              {r("play")}
            </a>
            {first && !isFirst ? (
              <a class="action primary" href={recordingsLink(first, mine)}>
                {r("compare_with", { name: first.name })}
              </a>
            ) : (
              <Button text={r("compare")} aria-pressed={isFirst} title={r("compare_hint")} onClick={compare} />
            )}
          </>
        )}
        <Download {...mine} name={name} kind="MCAP" hint={r("download_mcap_hint")} />
        {!empty && <Download {...mine} name={name} kind="CSV" hint={r("download_csv_hint")} rest="/values.csv" />}
        {mayAct.value && !(open && isOfFlight(recording)) && (
          <Button
            text={r("edit")}
            aria-expanded={editing}
            aria-label={r("edit_of", { name })}
            onClick={() => setEditing(!editing)}
          />
        )}
      </div>
      {editing && <RecordingEditor row={props.row} close={() => setEditing(false)} />}
    </li>
  );
}

const isOfFlight = (recording: Recording): boolean => recording.startedBy === "flight";

function Choose({ row, name, chosen }: { row: Row; name: string; chosen: Signal<ReadonlySet<string>> }) {
  const key = rowKey(row);
  const toggle = () => {
    const next = new Set(chosen.value);
    if (!next.delete(key)) next.add(key);
    chosen.value = next;
  };
  return (
    <label class="recording-choose" title={r("choose_hint")}>
      <input type="checkbox" checked={chosen.value.has(key)} aria-label={r("choose_of", { name })} onChange={toggle} />
    </label>
  );
}

/** Stops the recording, as the button of its robot does. */
function Stop({ row, name }: { row: Row; name: string }) {
  const { notice, isBusy, perform } = useOutcome((text) => r("not_done", { text }));
  const stop = () =>
    perform("", async () => {
      await askRecorder(`robomesh/${row.site}/${row.recording.robot}`, Action.TRACE_OFF);
      refreshSite(row.site);
      return undefined;
    });
  return (
    <>
      <Button
        text={r("stop_recording")}
        disabled={isBusy}
        aria-label={r("stop_of", { name })}
        onClick={() => void stop()}
      />
      {notice && <NoticeLine notice={notice} />}
    </>
  );
}

export function Download(props: RecordingName & { name: string; kind: string; hint: string; rest?: string }) {
  const { site, file, rest = "", kind } = props;
  const saved = file.replace(/\.mcap$/, kind === "CSV" ? ".csv" : ".mcap");
  return (
    <a
      class="action"
      href={fileUrl(site, file, rest)}
      download={saved}
      title={props.hint}
      aria-label={r("download_of", { name: props.name, kind })}
    >
      {kind}
    </a>
  );
}

/** A thumbnail from the file; a drawing if it has none. */
function Thumbnail({ site, recording }: { site: string; recording: Recording }) {
  const [none, setNone] = useState(false);
  if (isEmpty(recording)) {
    return (
      <span class="thumbnail" aria-hidden="true">
        <Silhouette label={r("no_thumbnail")} />
      </span>
    );
  }
  const has = !recording.open && recording.attachments.includes("thumbnail.jpg") && !none;
  return (
    <a class="thumbnail" href={recordingsLink({ site, file: recording.file })} tabIndex={-1} aria-hidden="true">
      {has ? (
        <img
          src={fileUrl(site, recording.file, "/thumbnail.jpg")}
          alt=""
          loading="lazy"
          onError={() => setNone(true)}
        />
      ) : (
        <Silhouette label={r("no_thumbnail")} />
      )}
    </a>
  );
}
