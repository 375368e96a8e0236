// What an operator's page showed when a request was sent: in the audit log, and as a still from a recording.

import { fromBinary } from "@bufbuild/protobuf";
import { EmptySchema, timestampFromMs } from "@bufbuild/protobuf/wkt";
import { useEffect, useRef, useState } from "preact/hooks";
import { CompressedVideoSchema } from "../gen/foxglove/CompressedVideo_pb";
import type { AuditEntry, Recording } from "../gen/robomesh_pb";
import { RangeRequestSchema, RecordedMessagesSchema, RecordingListSchema } from "../gen/robomesh_pb";
import { fixed, timeText } from "../i18n/format";
import { durationS, startMs } from "../i18n/recording-format";
import { t, viewText } from "../i18n/texts";
import { ask, inOwnName, reasonOf } from "../mesh/console/connection";
import { OWN_DRAWING } from "../mesh/control/display-freshness";
import { drawLast } from "./still";
import "./seen-picture.css";

const TIMEOUT_S = 20;
const SAME_MS = 0.01; // sources have microseconds
const MARGIN_MS = 2000; // a recorder receives a picture later than it was published
const MOST_PICTURES = 1000;

interface Seen {
  view: string;
  /** Of the picture's publication [ms since the Unix epoch]. */
  sourceMs: number | null;
  number: string;
  pictureAge: string | undefined;
  stateAge: string | undefined;
}

function seenOf({ values }: AuditEntry): Seen | null {
  const { page_view: view, page_picture_time: time, page_picture: number } = values;
  if (view === undefined) return null;
  return {
    view,
    sourceMs: time ? exactMs(time) : null,
    number: number ?? "",
    pictureAge: values.page_picture_age_s,
    stateAge: values.page_state_age_s,
  };
}

/** Return a time in ms with its microseconds, which `Date` drops. */
function exactMs(time: string): number {
  const fraction = /\.(\d+)/.exec(time)?.[1] ?? "";
  return Math.floor(Date.parse(time) / 1000) * 1000 + Number(`0.${fraction || 0}`) * 1000;
}

/** A button that summarizes the display of the sender's page and opens the picture; absent for other senders. */
export function SeenPicture({ site, robot, entry }: { site: string; robot: string; entry: AuditEntry }) {
  const [open, setOpen] = useState(false);
  const seen = seenOf(entry);
  if (!seen) return null;
  return (
    <>
      <button class="seen quiet" title={t("seen_hint")} onClick={() => setOpen(true)}>
        {summaryOf(seen)}
      </button>
      {open && <SeenDialog site={site} robot={robot} seen={seen} close={() => setOpen(false)} />}
    </>
  );
}

function summaryOf({ view, pictureAge, stateAge }: Seen): string {
  if (!view) return t("seen_state", { age: ageOf(stateAge) });
  return t("seen_view", { view: view === OWN_DRAWING ? t("scene") : viewText(view), age: ageOf(pictureAge) });
}

function ageOf(seconds: string | undefined): string {
  return seconds === undefined ? t("seen_age_unknown") : `${fixed(Number(seconds), 2)}\u202fs`;
}

function SeenDialog(props: { site: string; robot: string; seen: Seen; close: () => void }) {
  const { site, robot, seen } = props;
  const dialog = useRef<HTMLDialogElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const [text, setText] = useState(t("seen_searching"));
  const [found, setFound] = useState(false);
  // Not modal: STOP stays within reach.
  useEffect(() => dialog.current?.show(), []);
  useEffect(() => {
    let wanted = true;
    const show = async () => {
      if (!seen.view || seen.sourceMs === null) return t("seen_no_picture");
      if (seen.view === OWN_DRAWING) return t("seen_own_drawing");
      const still = await stillFrom(site, robot, seen.view, seen.sourceMs);
      if (!still) return t("seen_not_recorded");
      if (!wanted || !canvas.current) return "";
      await drawLast(still.pictures, canvas.current);
      setFound(true);
      return t(still.exact ? "seen_from" : "seen_from_before", { file: still.file });
    };
    show().then(
      (told) => wanted && setText(told),
      (error: unknown) => wanted && setText(t("seen_failed", { text: reasonOf(error) })),
    );
    return () => void (wanted = false);
  }, []);
  const facts: [string, string][] = [
    [t("view"), seen.view === OWN_DRAWING ? t("scene") : seen.view ? viewText(seen.view) : "–"],
    [t("seen_number"), seen.number || "–"],
    [t("seen_time"), seen.sourceMs === null ? "–" : timeText(seen.sourceMs, true)],
    [t("seen_picture_age"), ageOf(seen.pictureAge)],
    [t("seen_state_age"), ageOf(seen.stateAge)],
  ];
  return (
    <dialog
      ref={dialog}
      class="seen-dialog panel"
      aria-label={t("seen_title")}
      onClose={props.close}
      onKeyDown={(event) => event.key === "Escape" && dialog.current?.close()}
    >
      <div class="panel-head">
        <h2>{t("seen_title")}</h2>
        <button class="quiet panel-end" onClick={() => dialog.current?.close()}>
          {t("close")}
        </button>
      </div>
      <div class="seen-body grid gap-8">
        <div class="seen-still grid center" data-found={found}>
          <canvas ref={canvas} role="img" aria-label={t("seen_title")} hidden={!found} />
          {!found && <p class="dim">{text}</p>}
        </div>
        <dl>
          {facts.map(([name, value]) => (
            <div key={name}>
              <dt class="dim">{name}</dt>
              <dd>{value}</dd>
            </div>
          ))}
        </dl>
        <p class="dim small">
          {found && `${text} `}
          {t("seen_by_page")}
        </p>
      </div>
    </dialog>
  );
}

/** Find the picture in the recordings of its site; null: no recording has it. */
async function stillFrom(site: string, robot: string, view: string, sourceMs: number) {
  const key = `robomesh/${site}/-/recordings`;
  const { recordings } = await ask(`${key}/list`, EmptySchema, {}, RecordingListSchema, TIMEOUT_S);
  for (const recording of recordings) {
    const topic = recording.topics.find((each) => each.topic.endsWith(`/${robot}/video/${view}`))?.topic;
    if (!topic || !covers(recording, sourceMs)) continue;
    const request = {
      file: recording.file,
      topic,
      start: timestampFromMs(Math.floor(sourceMs) - MARGIN_MS),
      end: timestampFromMs(Math.ceil(sourceMs) + MARGIN_MS),
      most: MOST_PICTURES,
      fromKeyFrame: true,
    };
    const { messages } = await ask(
      inOwnName(`${key}/range`),
      RangeRequestSchema,
      request,
      RecordedMessagesSchema,
      TIMEOUT_S,
    );
    const before = messages.filter(({ source }) => source && msOf(source) <= sourceMs + SAME_MS);
    const last = before.at(-1)?.source;
    if (!last) continue;
    const pictures = before.map(({ data }) => fromBinary(CompressedVideoSchema, data).data);
    return { file: recording.file, pictures, exact: Math.abs(msOf(last) - sourceMs) <= SAME_MS };
  }
  return null;
}

function covers(recording: Recording, ms: number): boolean {
  const start = startMs(recording);
  return ms >= start - MARGIN_MS && (recording.open || ms <= start + durationS(recording) * 1000 + MARGIN_MS);
}

function msOf({ seconds, nanos }: { seconds: bigint; nanos: number }): number {
  return Number(seconds) * 1000 + nanos / 1e6;
}
