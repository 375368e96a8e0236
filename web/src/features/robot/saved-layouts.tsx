// Layouts that the site keeps under a name: open, save, rename, delete.

import { useEffect, useState } from "preact/hooks";
import type { StoredLayout } from "../../gen/robomesh_pb";
import { LayoutRequest_Action as Action, LayoutListSchema, LayoutRequestSchema } from "../../gen/robomesh_pb";
import { stampFull } from "../../i18n/format";
import { plotsText as p } from "../../i18n/texts";
import { mayAct } from "../../mesh/console/account";
import { ask } from "../../mesh/console/connection";
import { asker } from "../../mesh/services/alarms";
import { useTopic } from "../../mesh/state/topics";
import { Button } from "../../ui/inputs/button";
import { Select } from "../../ui/inputs/select";
import { submit } from "../../ui/inputs/submit";
import { TextInput } from "../../ui/inputs/text-input";
import { setLayoutQuery } from "../../ui/page/route";
import { NoticeLine } from "../../ui/panel/notice-line";
import { useOutcome } from "../../ui/panel/outcome";

const TIMEOUT_S = 10; // the answer waits for the disk
const LONGEST_NAME = 60;

/** @param props.text The layout in the address. */
export function SavedLayouts(props: { site: string; text: string }) {
  const { site, text } = props;
  const list = useTopic(LayoutListSchema, `robomesh/${site}/-/layouts`)?.message;
  const [chosen, setChosen] = useState("");
  const [name, setName] = useState("");
  const [deleting, setDeleting] = useState(false);
  const { notice, setNotice, isBusy, perform } = useOutcome((why) => p("not_changed", { why }));
  const layouts = list?.layouts ?? [];
  const opened = layouts.find((each) => each.name === chosen);
  const choose = (next: string) => {
    setChosen(next);
    setName(next);
    setDeleting(false);
  };
  // A link opens a saved layout, too. One that is edited stays chosen.
  const same = layouts.find((each) => each.text === text)?.name;
  useEffect(() => {
    if (same && opened?.text !== text) choose(same);
  }, [same]);
  const there = layouts.find((each) => each.name.toLowerCase() === name.trim().toLowerCase());
  const cannot = !list ? p("no_store") : !mayAct.value ? p("monitor") : !asker.value ? p("name_needed") : "";
  const send = (values: object, done: string, next: string) =>
    perform(p("sending"), async () => {
      const key = `robomesh/${site}/-/layouts/request/${asker.value}`;
      await ask(key, LayoutRequestSchema, values, LayoutListSchema, TIMEOUT_S);
      choose(next);
      return done;
    });
  const wanted = name.trim();
  const save = () =>
    send(
      { action: Action.SAVE, name: wanted, text, replace: there !== undefined },
      p("saved", { name: wanted }),
      wanted,
    );
  const rename = () =>
    send({ action: Action.RENAME, name: chosen, newName: wanted }, p("renamed", { old: chosen, name: wanted }), wanted);
  const remove = () => send({ action: Action.DELETE, name: chosen }, p("deleted", { name: chosen }), "");
  const able = !cannot && !isBusy && wanted !== "";
  return (
    <form
      class="layout-row row wrap gap-8-16 pad-8-16 saved-layouts ruled"
      aria-label={p("saved_layouts", { site })}
      onSubmit={submit(() => able && void save())}
    >
      <span class="row tall-32 gap-8">
        {p("saved_layouts", { site })}
        <Select
          label={p("saved_layouts", { site })}
          value={opened ? chosen : ""}
          values={["", ...layouts.map((each) => each.name)]}
          text={(value) => value || p(layouts.length ? "choose_layout" : "no_layouts")}
          choose={(value) => {
            const layout = layouts.find((each) => each.name === value);
            choose(value);
            setNotice(null);
            if (layout) setLayoutQuery(layout.text);
          }}
        />
      </span>
      <label>
        <span>{p("name")}</span>
        <TextInput
          maxLength={LONGEST_NAME}
          value={name}
          set={(text) => {
            setName(text);
            setDeleting(false);
          }}
        />
      </label>
      <Button
        primary
        text={there ? p("replace_layout") : p("save_layout")}
        type="submit"
        title={cannot}
        disabled={!able || there?.text === text}
      />
      <Button
        text={p("rename")}
        type="button"
        title={cannot}
        disabled={!able || !opened || wanted === chosen || (there !== undefined && there !== opened)}
        onClick={() => void rename()}
      />
      {deleting && opened ? (
        <>
          <Button text={p("keep_layout")} type="button" onClick={() => setDeleting(false)} />
          <Button
            destructive
            text={p("delete_named", { name: chosen })}
            type="button"
            disabled={!able}
            onClick={() => void remove()}
          />
        </>
      ) : (
        <Button
          text={p("delete_layout")}
          type="button"
          title={cannot}
          disabled={!able || !opened}
          onClick={() => setDeleting(true)}
        />
      )}
      <NoticeLine notice={notice} idle={byWhom(there ?? opened) || cannot} />
    </form>
  );
}

function byWhom(layout: StoredLayout | undefined): string {
  if (!layout) return "";
  return p("saved_by", { name: layout.name, author: layout.author, time: stampFull(layout.timestamp) });
}
