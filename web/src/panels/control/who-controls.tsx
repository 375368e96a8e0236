// The operator in control, requests and offers of control; and how to take, request or accept it.

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import type { Lease, Lease_Asker } from "../../gen/robomesh_pb";
import { ageText, stampFull, stampMs, stampWhen } from "../../i18n/format";
import { t } from "../../i18n/texts";
import { hello, reachable } from "../../mesh/console/connection";
import {
  accept,
  controlNotice,
  holds,
  offer,
  operator,
  ownName,
  release,
  requestControl,
  setOperator,
  take,
  takeOver,
} from "../../mesh/control/control";
import { Button } from "../../ui/inputs/button";
import { ReasonForm } from "../../ui/inputs/reason-form";
import { TextInput } from "../../ui/inputs/text-input";
import { mayNotCommand, NoControl } from "./no-control";

const MOST_ASKERS_SHOWN = 3;

/** In the panel's head: the operator in control, and since when. */
export function Holder(props: { robotKey: string; holder: string | null; lease: Lease | undefined }) {
  const { holder } = props;
  const mine = holds(props.robotKey);
  const elsewhere = holder && holder === operator.value.trim();
  const who = mine
    ? t("in_control")
    : holder === null
      ? t("holder_unknown")
      : !holder
        ? t("nobody")
        : t(elsewhere ? "elsewhere" : "somebody", { name: holder });
  return (
    <>
      <span
        class={`holder row clip ${mine ? "mine" : holder === null ? "dim" : ""}`}
        role="status"
        aria-label={t("who_controls")}
      >
        {mine && <span class="shape mine" aria-hidden="true" />}
        {who}
      </span>
      {holder && (
        <span class="since nowrap small dim" title={stampFull(props.lease?.since)}>
          {t("since", { time: stampWhen(props.lease?.since) })}
        </span>
      )}
    </>
  );
}

export function WhoControls(props: {
  robotKey: string;
  /** The operator in control; empty: none; null: not known. */
  holder: string | null;
  lease: Lease | undefined;
  readOnly: boolean;
}) {
  const { robotKey, lease } = props;
  const mine = holds(robotKey);
  // While the operator in control is not known, keep the buttons: none must change under the pointer.
  const other = (!mine && (props.holder ?? lease?.holder)) || "";
  const [sheet, setSheet] = useState<"ask" | "take" | null>(null);
  // A reason typed for one operator must not go to another.
  useEffect(() => setSheet(null), [other, stampMs(lease?.since)]);
  const open = (which: "ask" | "take") => ownName() && setSheet(which);
  if (mayNotCommand() && !mine) return <NoControl />;
  return (
    <>
      <div class="take-row flex gap-8 pad-0-16-8">
        <label class="operator grow narrow">
          <span class="unseen">{t("operator")}</span>
          <TextInput
            name="operator"
            autocomplete="username"
            maxLength={40}
            placeholder={t("operator")}
            title={t("operator_hint")}
            value={operator.value}
            disabled={mine || !!hello.value?.operator}
            set={setOperator}
            onKeyDown={(event) => event.key === "Enter" && !other && void take(robotKey)}
          />
        </label>
        {mine ? (
          <Button text={t("release")} onClick={() => void release()} />
        ) : other ? (
          <>
            {other !== operator.value.trim() && (
              <Button
                primary
                text={t("ask")}
                disabled={props.readOnly || !reachable.value}
                onClick={() => open("ask")}
              />
            )}
            <Button text={t("take_over")} disabled={props.readOnly || !reachable.value} onClick={() => open("take")} />
          </>
        ) : (
          <button
            class="action primary take"
            onClick={() => void take(robotKey)}
            disabled={props.readOnly || !reachable.value}
          >
            {t("take")}
          </button>
        )}
      </div>
      {sheet === "ask" && other && (
        <ReasonForm
          title={t("ask_from", { name: other })}
          text={t("ask_says", { name: other })}
          does={t("ask")}
          close={() => setSheet(null)}
          done={(reason) => void requestControl(robotKey, other, reason)}
        />
      )}
      {sheet === "take" && other && (
        <ReasonForm
          required
          title={t("take_from", { name: other })}
          text={t(lease?.motion ? "take_says_moving" : "take_says", { name: other })}
          does={t("take_from", { name: other })}
          close={() => setSheet(null)}
          done={(reason) => void takeOver(robotKey, reason)}
        />
      )}
    </>
  );
}

/** Say so when this operator's request for control has expired without an answer. */
function useExpiredRequest(lease: Lease | undefined, mine: boolean): void {
  const asked = useRef<{ by: string; holder: string; since: number } | null>(null);
  const me = operator.value.trim();
  useEffect(() => {
    if (!lease) return;
    const { holder } = lease;
    const since = stampMs(lease.since);
    const before = asked.current;
    const pending = me !== "" && lease.askedBy.some((asker) => asker.operator === me);
    asked.current = pending ? { by: me, holder, since } : null;
    // Control that ended, was offered or was handed over answers the request.
    const answered = mine || lease.offeredTo === me || holder !== before?.holder || since !== before.since;
    if (before?.by === me && !pending && !answered)
      controlNotice.value = { kind: "refused", text: t("ask_expired", { name: holder }) };
  }, [lease, mine, me]);
}

/** Requests and offers of control: every page shows them, the operators concerned can answer. */
export function ControlRequests(props: { robotKey: string; holder: string | null; lease: Lease | undefined }) {
  const { robotKey, holder, lease } = props;
  const mine = holds(robotKey);
  useExpiredRequest(lease, mine);
  if ((mayNotCommand() && !mine) || !holder || !lease) return null;
  return <Requests mine={mine} robotKey={robotKey} lease={lease} />;
}

function Requests({ mine, robotKey, lease }: { mine: boolean; robotKey: string; lease: Lease }) {
  const me = operator.value.trim();
  const { holder, offeredTo } = lease;
  const [declined, setDeclined] = useState<readonly string[]>([]);
  const idOf = (asker: Lease_Asker) => `${asker.operator} ${stampMs(asker.since)}`;
  const age = (asker: Lease_Asker) => ageText(Math.max(0, stampMs(lease.timestamp) - stampMs(asker.since)) / 1000);
  // An offer that was withdrawn and repeated is a new one.
  useEffect(() => setDeclined((old) => old.filter((each) => each !== "offer")), [offeredTo]);
  const decline = (what: string) => setDeclined([...declined, what]);
  const handOver = (asker: Lease_Asker) => {
    decline(idOf(asker)); // declined: withdrawing the offer must not show it again
    void offer(asker.operator);
  };
  const toMe = !mine && offeredTo !== "" && offeredTo === me;
  const asking = lease.askedBy.filter((each) => each.operator !== offeredTo && !declined.includes(idOf(each)));
  const shown = asking.slice(0, MOST_ASKERS_SHOWN);
  return (
    <div class="wishes" role="status">
      {offeredTo && !(toMe && declined.includes("offer")) && (
        <ControlRequest
          strong={toMe || mine}
          text={t(toMe ? "offers_you" : mine ? "offer_open" : "offers", { holder, name: offeredTo })}
        >
          {toMe && (
            <>
              <Button
                primary
                text={t("accept")}
                data-moves="new"
                disabled={!reachable.value}
                onClick={() => void accept(robotKey)}
              />
              <Button text={t("not_now")} data-moves="new" onClick={() => decline("offer")} />
            </>
          )}
          {mine && <Button text={t("withdraw")} data-moves="new" onClick={() => void offer(null)} />}
        </ControlRequest>
      )}
      {shown.map((asker) => (
        <ControlRequest
          key={idOf(asker)}
          strong={mine}
          text={t(asker.operator === me ? "you_ask" : "asks", { name: asker.operator, holder, age: age(asker) })}
          reason={asker.reason}
        >
          {mine && (
            <>
              <Button
                primary
                text={t("hand_over", { name: asker.operator })}
                data-moves="new"
                onClick={() => handOver(asker)}
              />
              <Button text={t("not_now")} data-moves="new" onClick={() => decline(idOf(asker))} />
            </>
          )}
        </ControlRequest>
      ))}
      {asking.length > shown.length && <ControlRequest text={t("more_ask", { count: asking.length - shown.length })} />}
    </div>
  );
}

function ControlRequest(props: { strong?: boolean; text: string; reason?: string; children?: ComponentChildren }) {
  return (
    <div
      class={`wish row wrap small dim gap-8 ${props.strong ? "strong" : ""}`}
      role="group"
      aria-label={t("control_request")}
    >
      <p>{props.reason ? t("with_reason", { text: props.text, reason: props.reason }) : props.text}</p>
      {props.children}
    </div>
  );
}
