// Export of a part of a recording: a table, or a video that the site renders while this page waits.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { create } from "@bufbuild/protobuf";
import { useEffect, useRef, useState } from "preact/hooks";
import { ReasonSchema } from "../../../gen/robomesh_pb";
import { fileUrl, momentText, viewName } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { RefusedRequest, readRefusal } from "../../../mesh/console/refusal";
import type { Notice } from "../../../mesh/control/control";
import { Button } from "../../../ui/inputs/button";
import { Select } from "../../../ui/inputs/select";
import { TextInput } from "../../../ui/inputs/text-input";
import type { RecordingName } from "../../../ui/page/route";
import { NoticeLine } from "../../../ui/panel/notice-line";

/** A line of the console's answer. */
interface Progress {
  state: "waiting" | "fetching" | "rendering" | "done" | "failed";
  progress?: number;
  id?: string;
  refusal?: MessageInitShape<typeof ReasonSchema>;
}

export function RangeExport(props: {
  name: RecordingName;
  durationS: number;
  /** Views that the site can render. */
  views: readonly string[];
  /** The player's position [s]. */
  position: () => number;
}) {
  const { name, durationS, views } = props;
  const [from, setFrom] = useState(0);
  const [to, setTo] = useState<number | null>(null);
  const [view, setView] = useState("");
  const [now, setNow] = useState<Progress | null>(null);
  const [notice, setNotice] = useState<Notice | null>(null);
  const running = useRef<AbortController | null>(null);
  useEffect(() => () => running.current?.abort(), []);
  const end = Math.min(to ?? durationS, durationS);
  const invalid = !(from >= 0 && from < end);
  const range = `from=${from.toFixed(3)}&to=${end.toFixed(3)}`;
  const chosen = views.includes(view) ? view : (views[0] ?? "");
  const render = async () => {
    const abort = new AbortController();
    running.current = abort;
    setNotice(null);
    setNow({ state: "waiting", progress: 0 });
    try {
      const url = fileUrl(name.site, name.file, `/video?${range}&view=${encodeURIComponent(chosen)}`);
      const last = await followLines(await fetch(url, { method: "POST", signal: abort.signal }), setNow);
      if (last.state !== "done") throw failed(last);
      save(fileUrl(name.site, name.file, `/video.mp4?id=${last.id}`));
      setNotice({ kind: "done", text: r("video_done") });
    } catch (error) {
      const text = error instanceof TypeError ? r("video_broken") : String((error as Error).message);
      setNotice(
        abort.signal.aborted
          ? { kind: "done", text: r("video_cancelled") }
          : { kind: "refused", text: r("video_failed", { text }) },
      );
    }
    setNow(null);
  };
  return (
    <fieldset class="range-export grid narrow gap-8 pad-8-0" aria-label={r("range")}>
      <div class="export-row">
        <Seconds label={r("range_from")} value={from} most={durationS} set={setFrom} here={props.position} />
        <Seconds label={r("range_to")} value={end} most={durationS} set={setTo} here={props.position} />
      </div>
      <div class="export-row">
        {!invalid && (
          <a class="action" href={fileUrl(name.site, name.file, `/values.csv?${range}`)} download="">
            {r("range_csv")}
          </a>
        )}
        {chosen && (
          <>
            <Select label={r("record_views")} value={chosen} values={views} text={viewName} choose={setView} />
            {now ? (
              <Button text={r("cancel")} onClick={() => running.current?.abort()} />
            ) : (
              <Button text={r("range_mp4")} disabled={invalid} onClick={() => void render()} />
            )}
          </>
        )}
      </div>
      {now && (
        <p class="range-progress grid gap-4">
          <progress max={1} value={now.progress ?? 0} aria-label={r(`video_${now.state}` as "video_waiting")} />
          <span class="figure small" role="status">
            {r(`video_${now.state}` as "video_waiting")} {Math.floor((now.progress ?? 0) * 100)} %
          </span>
        </p>
      )}
      {invalid && <p class="state warning small">{r("range_invalid", { duration: momentText(durationS) })}</p>}
      {notice && <NoticeLine notice={notice} />}
    </fieldset>
  );
}

/** Report each line of an answer, and return the last.
 *
 * @throws Error with the reason in words. */
async function followLines(answer: Response, report: (line: Progress) => void): Promise<Progress> {
  if (!answer.ok || !answer.body) throw await readRefusal(answer);
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let rest = "";
  let last: Progress = { state: "waiting" };
  for (;;) {
    const { done, value } = await reader.read();
    if (done) return last;
    const lines = (rest + value).split("\n");
    rest = lines.pop() ?? "";
    for (const line of lines.filter(Boolean)) {
      last = JSON.parse(line) as Progress;
      report(last);
    }
  }
}

/** The answer ended without a video. */
function failed({ refusal }: Progress): Error {
  if (!refusal) return new Error(r("video_broken"));
  const reason = create(ReasonSchema, refusal);
  return new RefusedRequest(0, reason.text, reason);
}

function save(url: string): void {
  const link = document.createElement("a");
  link.href = url;
  link.download = "";
  link.click();
}

function Seconds(props: {
  label: string;
  value: number;
  most: number;
  set: (value: number) => void;
  here: () => number;
}) {
  // What is being typed; null: nothing.
  const [text, setText] = useState<string | null>(null);
  const rounded = (value: number) => Math.round(Math.min(Math.max(value, 0), props.most) * 1000) / 1000;
  return (
    <span class="range-seconds flex gap-4">
      <label class="grow narrow">
        <span class="dim small">{props.label}</span>
        <TextInput
          inputMode="decimal"
          value={text ?? String(rounded(props.value))}
          set={setText}
          onChange={(event) => {
            const value = Number(event.currentTarget.value.replace(",", "."));
            if (event.currentTarget.value.trim() && Number.isFinite(value)) props.set(rounded(value));
            setText(null);
          }}
        />
      </label>
      <Button
        text={r("range_now")}
        aria-label={r("range_here", { what: props.label })}
        onClick={() => props.set(rounded(props.here()))}
      />
    </span>
  );
}
