// Recordings that are chosen for one download: a ZIP that the console streams.

import type { Signal } from "@preact/signals";
import { sizeText } from "../../../i18n/recording-format";
import { recordingsText as r } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import type { Row } from "./recordings-of-sites";

/** As the console allows. */
const MOST_IN_ZIP = 100;

export const rowKey = ({ site, recording }: Row): string => `${site}/${recording.file}`;

export function BulkDownload(props: {
  rows: readonly Row[];
  /** The rows that the filters show. */
  shown: readonly Row[];
  chosen: Signal<ReadonlySet<string>>;
}) {
  const { chosen } = props;
  // A deleted recording is chosen no more; one that runs has no end yet.
  const rows = props.rows.filter((row) => chosen.value.has(rowKey(row)) && !row.recording.open);
  if (rows.length === 0) return null;
  const bytes = rows.reduce((sum, { recording }) => sum + recording.bytes, 0n);
  const query = rows.map((row) => `recording=${encodeURIComponent(rowKey(row))}`).join("&");
  const isTooMany = rows.length > MOST_IN_ZIP;
  const all = props.shown.filter(({ recording }) => !recording.open).map(rowKey);
  return (
    <div class="compare-line row spread gap-16 pad-8-16 bulk-line" role="status">
      <span>
        {isTooMany
          ? r("zip_too_many", { count: rows.length, most: MOST_IN_ZIP })
          : r(rows.length === 1 ? "chosen_one" : "chosen", { count: rows.length, size: sizeText(bytes) })}
      </span>
      <span class="flex wrap gap-8">
        {!isTooMany && (
          <a class="action primary" href={`/recordings.zip?${query}`} download="recordings.zip" title={r("zip_hint")}>
            {r("zip")}
          </a>
        )}
        <Button
          text={r("choose_all", { count: all.length })}
          onClick={() => (chosen.value = new Set([...chosen.value, ...all]))}
        />
        <Button text={r("choose_none")} onClick={() => (chosen.value = new Set())} />
      </span>
    </div>
  );
}
