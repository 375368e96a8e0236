// Contents of a recording's file, and exports from it.

import { useState } from "preact/hooks";
import type { Recording } from "../../../gen/robomesh_pb";
import { count } from "../../../i18n/format";
import { durationS, lostText, sizeText, startedText, topicOf, viewName } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Select } from "../../../ui/inputs/select";
import { Warning } from "../../../ui/marks/warning";
import type { RecordingName } from "../../../ui/page/route";
import { Panel } from "../../../ui/panel/panel";
import { Download } from "../list/recording-card";
import { RangeExport } from "./range-export";
import "./contents.css";

export function Contents(props: {
  name: RecordingName;
  info: Recording | null;
  /** Of the replay; null: none is open. */
  robotKey: string | null;
  /** Views that can be saved during playback. */
  views: readonly string[];
  /** Views that the site can render. */
  rendered: readonly string[];
  position: () => number;
}) {
  const { name, info } = props;
  const title = info?.name || name.file;
  return (
    <Panel name="contents" title={r("contents")} end={info && <span class="dim">{sizeText(info.bytes)}</span>}>
      {info ? <Topics info={info} /> : <p class="skeleton contents-waiting">{"\u00a0"}</p>}
      <div class="export grid gap-8">
        <h3>{r("export")}</h3>
        <div class="export-row">
          <Download {...name} name={title} kind="MCAP" hint={r("download_mcap_hint")} />
          <Download {...name} name={title} kind="CSV" hint={r("download_csv_hint")} rest="/values.csv" />
        </div>
        {info && !info.open && (
          <RangeExport name={name} durationS={durationS(info)} views={props.rendered} position={props.position} />
        )}
        {props.robotKey && <LiveVideo robotKey={props.robotKey} views={props.views} title={title} />}
        <p class="dim small">{r("export_line")}</p>
        <Copyable text={exportLine(name)} />
      </div>
    </Panel>
  );
}

/** A command for any machine of the mesh; another view and `--size` are possible. */
function exportLine({ site, file }: RecordingName): string {
  return `robomesh recordings export ${site}/${file} ${file.replace(/\.mcap$/, ".mp4")} --view close`;
}

function Topics({ info }: { info: Recording }) {
  const lost = lostText(info);
  return (
    <>
      {lost && <Warning class="contents-lost small pad-0-16-8 state warning" text={lost} />}
      <table class="topics">
        <thead>
          <tr>
            <th scope="col">{r("topic")}</th>
            <th scope="col">{r("topic_messages")}</th>
            <th scope="col">{r("topic_lost")}</th>
          </tr>
        </thead>
        <tbody>
          {info.topics.map(({ topic, messages, lost: missing }) => (
            <tr key={topic} class={missing > 0n ? "is-lost" : ""}>
              <th scope="row">{topicOf(topic)}</th>
              <td>{count(messages)}</td>
              <td>{count(missing)}</td>
            </tr>
          ))}
        </tbody>
      </table>
      <p class="footnote dim">
        {[startedText(info), info.cause && r("cause", { text: info.cause })].filter(Boolean).join(" · ")}
      </p>
      {info.attachments.length > 0 && (
        <p class="footnote dim">{r("attached", { names: info.attachments.join(", ") })}</p>
      )}
    </>
  );
}

/** A button that saves a view's video during playback. */
function LiveVideo({ robotKey, views, title }: { robotKey: string; views: readonly string[]; title: string }) {
  const [view, setView] = useState("");
  const chosen = views.includes(view) ? view : (views[0] ?? "");
  if (!chosen) return null;
  const path = [...robotKey.split("/").slice(1), chosen].map(encodeURIComponent).join("/");
  return (
    <div class="export-row">
      <Select label={r("record_views")} value={chosen} values={views} text={viewName} choose={setView} />
      <a class="action" href={`/video/${path}.mp4`} download={`${title}-${chosen}.mp4`} title={r("export_mp4_live")}>
        {r("export_mp4", { view: viewName(chosen) })}
      </a>
      <p class="dim small">{r("export_mp4_live")}</p>
    </div>
  );
}

function Copyable({ text }: { text: string }) {
  const [copied, setCopied] = useState(false);
  return (
    <div class="copyable flex gap-8">
      <code tabIndex={0}>{text}</code>
      {"clipboard" in navigator && (
        <Button
          text={r(copied ? "copied" : "copy")}
          onClick={() => void navigator.clipboard.writeText(text).then(() => setCopied(true))}
        />
      )}
    </div>
  );
}
