// Fixtures and floor of a cell: choose, add, review and confirm a change, undo.

import { useState } from "preact/hooks";
import type { CellAnswer } from "../../gen/robomesh_pb";
import { reasonText } from "../../i18n/reasons";
import { cellText as c } from "../../i18n/texts";
import { isEngineer } from "../../mesh/console/account";
import { reasonOf } from "../../mesh/console/connection";
import { Button } from "../../ui/inputs/button";
import { ReasonForm } from "../../ui/inputs/reason-form";
import { Panel } from "../../ui/panel/panel";
import {
  account,
  add,
  askChange,
  beginUndo,
  chosen,
  discard,
  draft,
  FLOOR,
  isEdited,
  keep,
  type Mark,
  mayEdit,
  published,
  rows,
  shownContent,
} from "./cell-draft";
import { changeText, floorText, kindText, placeText } from "./cell-text";

export function ContentPanel({ robotKey }: { robotKey: string }) {
  const [review, setReview] = useState<CellAnswer | null>(null);
  const [said, setSaid] = useState<{ text: string; kind: "" | "done" | "refused" }>({ text: "", kind: "" });
  const [busy, setBusy] = useState(false);
  const state = published.value;
  const may = mayEdit.value && !busy;
  const outdated = draft.value !== null && state !== null && draft.value.basedOn !== state.version && !busy;
  const run = async (work: () => Promise<void>) => {
    setBusy(true);
    try {
      await work();
    } catch (error) {
      setSaid({ text: reasonOf(error), kind: "refused" });
    } finally {
      setBusy(false);
    }
  };
  const look = () =>
    run(async () => {
      setSaid({ text: "", kind: "" });
      setReview(await askChange(robotKey, true));
    });
  const confirm = (reason: string) =>
    run(async () => {
      const answer = await askChange(robotKey, false, reason);
      discard();
      setSaid({ text: c("done", { changes: answer.changes.map(changeText).join("; ") }), kind: "done" });
    });
  return (
    <Panel
      title={c("fixtures")}
      name="cell-content"
      end={
        <Button
          quiet
          text={c("undo")}
          type="button"
          disabled={!may || !state?.previous || review !== null}
          onClick={() => {
            beginUndo();
            void look();
          }}
        />
      }
    >
      <ul class="pad-0-8">
        <Row name="" kind={c("floor")} detail={floorText(shownContent.value?.floor)} mark={floorMark()} />
        {rows.value.map(({ fixture, mark }) => (
          <Row
            key={fixture.name}
            name={fixture.name}
            kind={kindText(fixture)}
            detail={placeText(fixture)}
            mark={mark}
          />
        ))}
      </ul>
      {state?.cell && (
        <div class="cell-add flex wrap gap-8 pad-8-16" role="group" aria-label={c("add")}>
          {(["box", "cylinder", "sphere"] as const).map((kind) => (
            <Button key={kind} text={c(`add_${kind}`)} type="button" disabled={!may} onClick={() => add(kind)} />
          ))}
        </div>
      )}
      {review ? (
        <ReasonForm
          title={c("review_title")}
          text={c("review_text", { file: state?.file || "site.toml" })}
          does={c("change")}
          close={() => setReview(null)}
          done={(reason) => void confirm(reason)}
        >
          <ul class="break">
            {review.changes.map((each) => (
              <li key={`${each.fixture}.${each.key}`}>{changeText(each)}</li>
            ))}
          </ul>
        </ReasonForm>
      ) : (
        <div class="cell-actions flex wrap gap-8 pad-8-16 to-end">
          <Button
            text={c("discard")}
            type="button"
            disabled={!draft.value || busy}
            onClick={() => {
              discard();
              setSaid({ text: "", kind: "" });
            }}
          />
          <Button
            primary
            text={c("review")}
            type="button"
            disabled={!may || !isEdited.value}
            onClick={() => void look()}
          />
        </div>
      )}
      <p class={`notice ${said.kind}`} role="status">
        {notice(said.text, outdated, busy)}
      </p>
    </Panel>
  );
}

function notice(said: string, outdated: boolean, busy: boolean): string {
  const state = published.value;
  if (state?.changing || (busy && !said)) return c("changing");
  if (outdated) return c("outdated");
  if (said) return said;
  if (!isEngineer.value) return c("read_only", { account: account.value });
  if (state?.problem) return c("cannot", { text: reasonText(state.problem, state.problem.text) });
  return isEdited.value ? c("preview") : "";
}

function Row(props: { name: string; kind: string; detail: string; mark: Mark }) {
  const { name, mark } = props;
  const label = name || c("floor");
  const value = name || FLOOR;
  const old = published.value?.content?.fixtures.find((each) => each.name === name);
  return (
    <li class={`cell-row row gap-8 ${mark}`}>
      <button
        type="button"
        class="cell-pick pick flex wrap baseline grow narrow small tall-44 pad-8"
        aria-pressed={chosen.value === value}
        onClick={() => (chosen.value = value)}
      >
        <strong>{label}</strong>
        <span class="dim">{name ? `${props.kind} · ${props.detail}` : props.detail}</span>
      </button>
      {mark && <span class="cell-mark">{c(mark)}</span>}
      {mark === "removed" && old && (
        <Button quiet text={c("keep")} type="button" disabled={!mayEdit.value} onClick={() => keep(old)} />
      )}
    </li>
  );
}

function floorMark(): Mark {
  const before = floorText(published.value?.content?.floor);
  return draft.value && floorText(draft.value.content.floor) !== before ? "changed" : "";
}
