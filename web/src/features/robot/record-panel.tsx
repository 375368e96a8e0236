// Recording from the robot's page: start with a name and views, show written and lost messages, stop.

import { signal } from "@preact/signals";
import type { JSX } from "preact";
import { useState } from "preact/hooks";
import type { Description, Recording } from "../../gen/robomesh_pb";
import { RecordingSchema } from "../../gen/robomesh_pb";
import { ageText, count } from "../../i18n/format";
import { reasonText } from "../../i18n/reasons";
import { durationS, lostText, messagesOf, momentText, sizeText, startedText } from "../../i18n/recording-format";
import { recordingsText as r, viewText } from "../../i18n/texts";
import { presence } from "../../mesh/console/connection";
import { Action, askRecorder } from "../../mesh/services/recorder";
import { ageOf, isStale } from "../../mesh/state/staleness";
import { useTopic } from "../../mesh/state/topics";
import { viewsOf } from "../../scene/scene-view";
import { Button } from "../../ui/inputs/button";
import { Select } from "../../ui/inputs/select";
import { submit } from "../../ui/inputs/submit";
import { TextInput } from "../../ui/inputs/text-input";
import { recordingsLink } from "../../ui/page/route";
import { useOutcome } from "../../ui/panel/outcome";
import "../../ui/marks/replay.css";
import "./record-panel.css";

const NO_VIDEO = "-";
const AS_THE_SITE = "";

/** Whether the panel is open, for all robots. */
const shown = signal(false);

/** Return a robot's current or last recording, and how long its recorder has been silent. */
function useRecording(robotKey: string): { recording: Recording | undefined; open: boolean; staleFor: number | null } {
  const latest = useTopic(RecordingSchema, `${robotKey}/recording`);
  const age = ageOf(latest);
  const open = latest?.message.open === true;
  return { recording: latest?.message, open, staleFor: open && isStale("recording", age) ? (age ?? 0) : null };
}

/** A button that opens the panel and shows the recording's state. */
export function RecordButton({ robotKey }: { robotKey: string }) {
  const { recording, open, staleFor } = useRecording(robotKey);
  const lost = open && recording ? lostText(recording) : "";
  return (
    <button
      class={`record-button ${open ? "open" : ""}`}
      aria-expanded={shown.value}
      onClick={() => (shown.value = !shown.value)}
    >
      <span class="record-dot" aria-hidden="true" />
      {open && recording ? (
        <>
          {r("recording_now")}
          {staleFor === null && <span class="figure">{momentText(durationS(recording), 0)}</span>}
        </>
      ) : (
        r("record")
      )}
      {(lost || staleFor !== null) && <span class="shape warning" title={lost} aria-hidden="true" />}
    </button>
  );
}

export function RecordPanel({ robotKey, description }: { robotKey: string; description: Description | undefined }) {
  const [, site = ""] = robotKey.split("/");
  const { recording, open, staleFor } = useRecording(robotKey);
  const there = [...presence.value].some((key) => key.startsWith(`robomesh/${site}/-/alive/recorder/`));
  const { notice, isBusy, perform } = useOutcome((text) => r("not_done", { text }));
  const does = (action: Action, busy: string, values = {}) =>
    perform(busy, async () => void (await askRecorder(robotKey, action, values)));
  if (!shown.value) return null;
  const words =
    notice?.text ??
    (!there ? r("record_gone") : staleFor !== null ? r("record_stale", { age: ageText(staleFor) }) : "");
  return (
    <section class="panel record-panel" aria-label={r("record")}>
      {open && recording ? (
        <div class="record-row row wrap gap-8-16 pad-8-16">
          <strong class="break">{recording.name}</strong>
          <Counts recording={recording} />
          <Button
            text={r("record_stop")}
            disabled={isBusy}
            onClick={() => void does(Action.TRACE_OFF, r("record_stopping"))}
          />
        </div>
      ) : (
        <Start
          last={<Last site={site} recording={recording} />}
          description={description}
          busy={isBusy}
          start={(name, views) => void does(Action.TRACE_ON, r("record_starting"), { name, views })}
        />
      )}
      {words && (
        <p class={`notice ${notice?.kind ?? ""}`} role={notice?.kind === "refused" ? "alert" : "status"}>
          {!isBusy && <span class="shape warning" aria-hidden="true" />}
          {words}
        </p>
      )}
    </section>
  );
}

function Start(props: {
  description: Description | undefined;
  busy: boolean;
  last: JSX.Element;
  start: (name: string, views: string[]) => void;
}) {
  const [name, setName] = useState("");
  const [views, setViews] = useState(AS_THE_SITE);
  return (
    <form
      class="record-row row wrap gap-8-16 pad-8-16"
      onSubmit={submit(() => props.start(name.trim().replace(/\s+/g, "-"), views ? [views] : []))}
    >
      <TextInput
        maxLength={80}
        aria-label={r("record_name")}
        placeholder={r("record_name_hint")}
        value={name}
        set={setName}
      />
      <label class="row gap-8">
        <span class="dim small">{r("record_views")}</span>
        <Select
          value={views}
          values={[AS_THE_SITE, NO_VIDEO, ...viewsOf(props.description).map(({ name }) => name)]}
          text={sourceText}
          choose={setViews}
        />
      </label>
      <Button primary text={r("record_start")} disabled={props.busy} type="submit" />
      {props.last}
    </form>
  );
}

function sourceText(views: string): string {
  if (views === AS_THE_SITE) return r("record_views_site");
  return views === NO_VIDEO ? r("record_views_none") : viewText(views);
}

/** A link to the last recording. */
function Last({ site, recording }: { site: string; recording: Recording | undefined }) {
  if (!recording?.name)
    return (
      <a class="clip push" href={recordingsLink()}>
        {r("back")}
      </a>
    );
  return (
    <span class="clip push dim">
      {r("record_last")}
      <a href={recordingsLink({ site, file: recording.file })}>{recording.name}</a>
    </span>
  );
}

function Counts({ recording }: { recording: Recording }) {
  const lost = lostText(recording);
  return (
    <p class="record-counts flex wrap gap-0-16">
      <span class="figure">{momentText(durationS(recording), 0)}</span>
      <span class="figure">{r("messages", { count: count(messagesOf(recording)) })}</span>
      <span class="figure">{sizeText(recording.bytes)}</span>
      <span>{startedText(recording)}</span>
      <span class={lost ? "state warning" : "dim"}>
        {lost && <span class="shape warning" aria-hidden="true" />}
        {lost || r("lost_none")}
      </span>
      {recording.problem && <span class="state warning">{reasonText(recording.problemReason, recording.problem)}</span>}
    </p>
  );
}
