// How two texts differ: unified or side by side; or one whole text.

import { useMemo, useState } from "preact/hooks";
import { count } from "../../../i18n/format";
import { storedText as s } from "../../../i18n/texts";
import { Choice } from "../../../ui/inputs/choice";
import type { Row } from "./diff";
import { diffRows, sideBySide } from "./diff";

const VIEWS = ["unified", "side_by_side", "whole"] as const;
const SIGNS = { same: " ", old: "−", new: "+", gap: "" } as const;

export function Difference(props: { oldText: string; newText: string; whole: string | null }) {
  const { oldText, newText, whole } = props;
  const [view, setView] = useState<(typeof VIEWS)[number]>(whole === null ? "unified" : "whole");
  const rows = useMemo(() => diffRows(oldText, newText), [oldText, newText]);
  const removed = rows.filter(({ kind }) => kind === "old").length;
  const added = rows.filter(({ kind }) => kind === "new").length;
  return (
    <div class="grid gap-8" role="region" aria-label={s("difference")}>
      <div class="stored-tools">
        <Choice label={s("view")} values={VIEWS} chosen={view} text={(each) => s(each)} choose={setView} />
        <span class="dim small">
          {rows.length === 0
            ? s("equal")
            : `${s("removed_lines", { count: count(removed) })} · ${s("added_lines", { count: count(added) })}`}
        </span>
      </div>
      <div class="diff-scroll" tabIndex={0} role="group" aria-label={s("difference")}>
        {view === "unified" && (
          <table class="diff">
            <tbody>
              {rows.map((row, at) => (
                <tr key={at} class={`diff-${row.kind}`}>
                  <LineNumber row={row} of="old" />
                  <LineNumber row={row} of="new" />
                  <Line row={row} />
                </tr>
              ))}
            </tbody>
          </table>
        )}
        {view === "side_by_side" && (
          <table class="diff">
            <tbody>
              {sideBySide(rows).map((pair, at) => (
                <tr key={at}>
                  {(["old", "new"] as const).map((side) => (
                    <Half key={side} row={pair[side]} side={side} />
                  ))}
                </tr>
              ))}
            </tbody>
          </table>
        )}
        {view === "whole" && <pre class="diff-whole">{whole ?? newText}</pre>}
      </div>
    </div>
  );
}

function Half({ row, side }: { row: Row | null; side: "old" | "new" }) {
  if (!row) return <td class="diff-none" colSpan={2} />;
  return (
    <>
      <LineNumber row={row} of={side} half />
      <Line row={row} half />
    </>
  );
}

function LineNumber({ row, of, half }: { row: Row; of: "old" | "new"; half?: boolean }) {
  const number = of in row ? row[of as keyof Row] : "";
  return <td class={`diff-number dim right ${half ? `diff-${row.kind}` : ""}`}>{number}</td>;
}

function Line({ row, half }: { row: Row; half?: boolean }) {
  if (row.kind === "gap") return <td class="diff-text diff-gap">{s("equal_lines", { count: row.count })}</td>;
  return (
    <td class={`diff-text ${half ? `diff-${row.kind}` : ""}`}>
      <span class="diff-sign">{SIGNS[row.kind]}</span>
      {row.kind === "old" ? <del>{row.text}</del> : row.kind === "new" ? <ins>{row.text}</ins> : row.text}
    </td>
  );
}
