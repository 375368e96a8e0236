// The alarm list after ISA-18.2: select, acknowledge and shelve alarms, one or many at a time.

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { alarmText } from "../../i18n/alarm-text";
import type { NameIn } from "../../i18n/texts";
import { eventsText as e, t } from "../../i18n/texts";
import { mayAct } from "../../mesh/console/account";
import { hello } from "../../mesh/console/connection";
import { operator, setOperator } from "../../mesh/control/control";
import type { Alarm } from "../../mesh/services/alarms";
import {
  Action,
  ALARM_ORDERS,
  act,
  alarms,
  anyWatch,
  asker,
  isUnacknowledged,
  nameOf,
  Priority,
  State,
  silentSites,
  sorted,
} from "../../mesh/services/alarms";
import { setSound, sound } from "../../panels/alarm-sound";
import { Button } from "../../ui/inputs/button";
import { Choice, Toggle } from "../../ui/inputs/choice";
import { Select } from "../../ui/inputs/select";
import { TextInput } from "../../ui/inputs/text-input";
import { Warning } from "../../ui/marks/warning";
import { NoticeLine } from "../../ui/panel/notice-line";
import { useOutcome } from "../../ui/panel/outcome";
import { AlarmLine } from "./alarm-line";
import { ShelveForm } from "./shelve-form";

const SHOWN = ["all", "unacknowledged", "shelved"] as const;
type Shown = (typeof SHOWN)[number];
const LEAST = { any_priority: Priority.LOW, from_medium: Priority.MEDIUM, from_high: Priority.HIGH } as const;
const MOST_SHOWN = 200; // more are of no use to an operator; these are the most urgent

const DONE = new Map<Action, NameIn<"events">>([
  [Action.ACKNOWLEDGE, "acknowledged"],
  [Action.SHELVE, "shelved"],
  [Action.UNSHELVE, "unshelved"],
]);

function passes(alarm: Alarm, shown: Shown): boolean {
  if (shown === "shelved") return alarm.state === State.SHELVED;
  return shown === "unacknowledged" ? isUnacknowledged(alarm) : alarm.state !== State.SHELVED;
}

export function AlarmPanel() {
  const [shown, setShown] = useState<Shown>("all");
  const [least, setLeast] = useState<keyof typeof LEAST>("any_priority");
  const [site, setSite] = useState("");
  const [text, setText] = useState("");
  const [order, setOrder] = useState<keyof typeof ALARM_ORDERS>("order_priority");
  const [selected, setSelected] = useState<ReadonlySet<string>>(new Set());
  const [shelving, setShelving] = useState<readonly Alarm[] | null>(null);
  const { notice, perform } = useOutcome((text) => e("not_done", { text }));

  const all = alarms.value;
  const searchText = text.trim().toLowerCase();
  const listed = all.filter(
    (alarm) =>
      passes(alarm, shown) &&
      alarm.priority >= LEAST[least] &&
      (!site || alarm.site === site) &&
      wordsOf(alarm).toLowerCase().includes(searchText),
  );
  const drawn = sorted(listed, order).slice(0, MOST_SHOWN);
  const chosen = drawn.filter((alarm) => selected.has(nameOf(alarm)));
  const open = drawn.filter(isUnacknowledged);
  const openChosen = chosen.filter(isUnacknowledged);
  const able = mayAct.value && asker.value !== "";

  const run = (some: readonly Alarm[], action: Action, values?: { reason: string; shelveS: number }) =>
    perform(e("acting"), async () => {
      await act(some, action, values);
      setSelected(new Set());
      return e(DONE.get(action) ?? "acknowledged", { count: some.length });
    });
  const select = (alarm: Alarm, on: boolean) => {
    const names = new Set(selected);
    if (on) names.add(nameOf(alarm));
    else names.delete(nameOf(alarm));
    setSelected(names);
  };

  return (
    <section class="panel alarms" aria-label={e("alarms")}>
      <div class="panel-head">
        <h1>{e("alarms")}</h1>
        <Choice
          label={e("state")}
          values={SHOWN}
          chosen={shown}
          text={(each) => `${e(`show_${each}`)} ${all.filter((alarm) => passes(alarm, each)).length}`}
          choose={setShown}
        />
        <span class="panel-end">
          <Toggle text={`${e("sound")}: ${e(sound.value ? "on" : "off")}`} on={sound.value} set={setSound} />
        </span>
      </div>
      <div class="list-tools flex wrap spread">
        <Filters>
          <Select
            label={e("priority")}
            value={least}
            values={Object.keys(LEAST) as (keyof typeof LEAST)[]}
            text={e}
            choose={setLeast}
          />
          <Select
            label={e("order")}
            value={order}
            values={Object.keys(ALARM_ORDERS) as (keyof typeof ALARM_ORDERS)[]}
            text={e}
            choose={setOrder}
          />
          <SiteSelect site={site} sites={all.map((alarm) => alarm.site)} choose={setSite} />
          <TextInput type="search" hint={e("search")} value={text} set={setText} />
        </Filters>
        {all.length > 0 && mayAct.value && (
          <div class="list-actions row wrap gap-8 pad-4-16-8">
            {!hello.value?.operator && <Name />}
            {openChosen.length > 0 ? (
              <Button
                primary
                text={e("acknowledge_selected", { count: openChosen.length })}
                disabled={!able}
                onClick={() => void run(openChosen, Action.ACKNOWLEDGE)}
              />
            ) : (
              <Button
                text={e("acknowledge_shown", { count: open.length })}
                disabled={!able || open.length === 0}
                onClick={() => void run(open, Action.ACKNOWLEDGE)}
              />
            )}
            <Button
              text={e("shelve_selected")}
              disabled={!able || chosen.length === 0}
              onClick={() => setShelving(chosen)}
            />
          </div>
        )}
      </div>
      {shelving && (
        <ShelveForm
          alarms={shelving}
          close={() => setShelving(null)}
          done={(reason, shelveS) => void run(shelving, Action.SHELVE, { reason, shelveS })}
        />
      )}
      {silentSites().map((name) => (
        <Warning key={name} class="banner warning" text={e("badge_silent", { sites: name })} />
      ))}
      {drawn.length === 0 ? (
        <p class="empty">
          {!anyWatch.value
            ? e("no_watch")
            : all.length === 0
              ? e("no_alarms")
              : e("no_alarms_match", { count: all.length })}
        </p>
      ) : (
        <ul class="alarm-list scroll ruled" aria-label={e("alarms")}>
          {drawn.map((alarm) => (
            <AlarmLine
              key={nameOf(alarm)}
              alarm={alarm}
              selected={selected.has(nameOf(alarm))}
              select={(on) => select(alarm, on)}
              able={able}
              acknowledge={() => void run([alarm], Action.ACKNOWLEDGE)}
              shelve={() => setShelving([alarm])}
              unshelve={() => void run([alarm], Action.UNSHELVE)}
            />
          ))}
        </ul>
      )}
      {listed.length > drawn.length && (
        <p class="footnote dim">{e("more_alarms", { count: listed.length - drawn.length })}</p>
      )}
      <NoticeLine notice={notice} idle={mayAct.value ? "" : e("may_not")} />
    </section>
  );
}

/** Filters of a list; on a phone they open on request, so that the list stays visible. */
export function Filters({ children }: { children: ComponentChildren }) {
  const [open, setOpen] = useState(false);
  return (
    <>
      <button class="action filters-open" aria-expanded={open} onClick={() => setOpen(!open)}>
        {e("filter")}
      </button>
      <div class={`list-filter flex wrap gap-8 pad-4-16-8 ${open ? "unfolded" : ""}`}>{children}</div>
    </>
  );
}

/** The name of the operator, for consoles without accounts. */
function Name() {
  return (
    <label class="alarm-name row wrap gap-4-8">
      {!asker.value && <span class="warned">{e("name_needed")}</span>}
      <TextInput
        name="operator"
        autocomplete="username"
        maxLength={40}
        hint={t("operator")}
        title={t("operator_hint")}
        value={operator.value}
        set={setOperator}
      />
    </label>
  );
}

export function SiteSelect(props: { site: string; sites: readonly string[]; choose: (site: string) => void }) {
  const sites = [...new Set(props.sites)].sort();
  if (sites.length < 2) return null;
  return (
    <Select
      label={e("site")}
      value={props.site}
      values={["", ...sites]}
      text={(name) => name || e("every_site")}
      choose={props.choose}
    />
  );
}

/** All texts in which the filter searches. */
function wordsOf(alarm: Alarm): string {
  const { text, code, site, robot, source } = alarm;
  return `${text} ${alarmText(alarm) ?? ""} ${code} ${site} ${robot} ${source}`;
}
