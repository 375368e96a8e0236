// How each pair of links is checked, or why it is ignored; the user may ignore more.

import { useEffect } from "preact/hooks";
import type { NameIn } from "../../../i18n/texts";
import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { Warning } from "../../../ui/marks/warning";
import type { PairRow } from "../draft/collision-plan";
import {
  isPlanned,
  isSame,
  isTouching,
  pairRows,
  planAgain,
  planError,
  planning,
  startPlanning,
} from "../draft/collision-plan";
import { draft, editDraft } from "../draft/draft";
import { ProblemWords } from "../draft/fields";
import type { PairKind } from "../draft/server-requests";

const KIND_TEXTS: Readonly<Partial<Record<PairKind, NameIn<"define">>>> = {
  collision_meshes: "way_collision_meshes",
  visual_meshes: "way_visual_meshes",
  false_contacts: "way_collision_meshes",
};
const REASONS: Readonly<Record<PairKind, NameIn<"define"> | null>> = {
  adjacent: "pair_adjacent",
  description: "pair_description",
  always: "pair_always",
  apart: null,
  collision_meshes: "pair_hulls_touch",
  visual_meshes: "pair_hulls_touch",
  false_contacts: "pair_false_contacts",
  too_large: "pair_too_large",
  touching: "pair_touching",
  no_surface: "pair_no_surface",
  not_studied: "pair_not_studied",
};

function setIgnored(links: readonly [string, string], ignored: boolean): void {
  editDraft(({ description }) => {
    const others = description.collision.ignore.filter((pair) => !isSame(pair, links));
    description.collision.ignore = ignored ? [...others, [...links]] : others;
  });
}

export function CollisionsTab() {
  useEffect(startPlanning, []);
  const now = draft.value;
  if (!now) return null;
  const rows = pairRows.value;
  const { ignore } = now.description.collision;
  return (
    <>
      <div class="tab-intro">
        <p class="dim small">{d("collisions_words")}</p>
      </div>
      <PlanState rows={rows} />
      {rows.length > 0 && (
        <table class="pairs wide small" aria-label={d("collisions")} aria-busy={planning.value}>
          <thead>
            <tr>
              <th scope="col">{d("ignore")}</th>
              <th scope="col">{d("pair")}</th>
              <th scope="col">{d("pair_check")}</th>
            </tr>
          </thead>
          <tbody>
            {rows.map((row) => (
              <Row key={row.links.join(" ")} row={row} place={ignore.findIndex((pair) => isSame(pair, row.links))} />
            ))}
          </tbody>
        </table>
      )}
      <ProblemWords path="collision" />
    </>
  );
}

/** A summary of the plan, or why it is missing. */
function PlanState({ rows }: { rows: readonly PairRow[] }) {
  if (planError.value) {
    return (
      <div class="plan-state grid gap-4 pad-0-16-12" role="alert">
        <Warning class="problem-word" text={d("plan_failed", { text: planError.value })} />
        <Button quiet text={d("plan_again")} onClick={planAgain} />
      </div>
    );
  }
  const ignored = rows.filter(({ isIgnored }) => isIgnored).length;
  const touching = rows.filter(isTouching).length;
  return (
    <div class="plan-state grid gap-4 pad-0-16-12" role="status">
      {isPlanned.value && rows.length === 0 && <p class="dim small">{d("no_pairs")}</p>}
      {isPlanned.value && rows.length > 0 && (
        <>
          <p class={touching ? "problem-word" : "small"}>
            <span class={`shape ${touching ? "warning" : ""}`} aria-hidden="true" />
            {touching === 0
              ? d("plan_free")
              : touching === 1
                ? d("plan_touching_one")
                : d("plan_touching", { count: touching })}
          </p>
          <p class="dim small">{d("plan_counts", { checked: rows.length - ignored, ignored })}</p>
        </>
      )}
      {!isPlanned.value && <p class="dim small">{d("planning")}</p>}
    </div>
  );
}

function Row({ row, place }: { row: PairRow; place: number }) {
  const { links, kind, values, isIgnored, isAutomatic } = row;
  const [first, second] = links;
  const reason = REASONS[kind];
  const formatted = Object.fromEntries(
    Object.entries(values).map(([name, value]) => [name, value.toLocaleString("en")]),
  );
  return (
    <tr class={isTouching(row) ? "touching" : isIgnored ? "ignored" : ""}>
      <td>
        <input
          type="checkbox"
          {...(place >= 0 && { "data-path": `collision/ignore/${place}` })}
          aria-label={d("pair_label", { first, second })}
          checked={isIgnored}
          disabled={isAutomatic}
          onChange={(event) => setIgnored(links, event.currentTarget.checked)}
        />
      </td>
      <td>
        {first} – {second}
      </td>
      <td>
        <span class="way">{d(isIgnored ? "way_ignored" : (KIND_TEXTS[kind] ?? "way_hulls"))}</span>
        {reason && <span class="dim"> {d(reason, formatted)}</span>}
      </td>
    </tr>
  );
}
