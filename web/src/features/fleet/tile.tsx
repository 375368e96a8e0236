// One robot of the fleet. An invisible tile shows only its name, without subscriptions or drawing.

import { fromBinary } from "@bufbuild/protobuf";
import { useEffect, useRef, useState } from "preact/hooks";
import { JointStatesSchema } from "../../gen/foxglove/JointStates_pb";
import type { Description } from "../../gen/robomesh_pb";
import { DescriptionSchema } from "../../gen/robomesh_pb";
import { robotTitle, staleText, stampFull, stampWhen } from "../../i18n/format";
import { fleetText as f, t } from "../../i18n/texts";
import { hello, watch } from "../../mesh/console/connection";
import { alarmsOf } from "../../mesh/services/alarms";
import { robotSnapshot } from "../../mesh/state/robot-snapshots";
import { problemOf, stateWord } from "../../mesh/state/robot-state";
import { ageOf, isStale } from "../../mesh/state/staleness";
import { now, useTopic } from "../../mesh/state/topics";
import { AliveServices } from "../../panels/alive-services";
import { PriorityMark } from "../../ui/marks/priority-mark";
import { RobotTags } from "../../ui/marks/robot-tags";
import { Silhouette } from "../../ui/marks/silhouette";
import { State } from "../../ui/marks/state";
import { Tag } from "../../ui/marks/tag";
import { robotLink } from "../../ui/page/route";
import { useVisible } from "./visibility";

export function RobotTile({ robotKey }: { robotKey: string }) {
  const place = useRef<HTMLAnchorElement>(null);
  const visible = useVisible(place);
  const [, site = "", robot = ""] = robotKey.split("/");
  const level = visible ? stateWord(robotSnapshot(robotKey).controller.value).level : "";
  return (
    <a ref={place} class={`tile card ${level}`} href={robotLink(site, robot)} data-robot={robotKey}>
      {visible ? <Shown robotKey={robotKey} site={site} robot={robot} /> : <InvisibleTile robot={robot} />}
    </a>
  );
}

function InvisibleTile({ robot }: { robot: string }) {
  return (
    <>
      <div class="tile-picture" aria-hidden="true">
        <span class="dim">{f("loading")}</span>
      </div>
      <div class="tile-body">
        <div class="tile-line">
          <strong>{robot}</strong>
        </div>
      </div>
    </>
  );
}

function Shown({ robotKey, site, robot }: { robotKey: string; site: string; robot: string }) {
  const known = robotSnapshot(robotKey);
  const [controller, lease] = [known.controller.value, known.lease.value];
  const newest = useTopic(DescriptionSchema, `${robotKey}/description`)?.message;
  if (newest) known.description = newest;
  const description = known.description;
  const state = stateWord(controller);
  const age = ageOf(controller);
  const unitAge = age === null ? null : age + (controller?.message.lastUnitAgeS ?? 0);
  const stale = isStale("controller", unitAge);
  const leaseKnown = lease !== undefined && !isStale("lease", ageOf(lease));
  const holder = lease?.message.holder;
  const problem = problemOf(state, controller?.message);
  const alarms = alarmsOf.value.get(robotKey) ?? [];
  const worst = alarms.reduce((most, { priority }) => Math.max(most, priority), 0);
  const isRemote = hello.value !== null && hello.value.site !== site;
  return (
    <>
      <Picture robotKey={robotKey} description={description} stale={stale} />
      <div class="tile-body">
        <div class="tile-line">
          <strong>{robot}</strong>
          <State state={state} />
        </div>
        <div class="tile-line dim">
          <span class="narrow clip">
            {description ? robotTitle(description) : "\u00a0"}
            {isRemote && <span title={f("far_hint")}> · {f("far")}</span>}
          </span>
          {stale ? (
            <span class="age">{staleText(unitAge)}</span>
          ) : (
            <span class="flex gap-8">
              <RobotTags state={controller?.message} />
              {description?.simulated && <Tag kind="simulated">{t("simulated")}</Tag>}
            </span>
          )}
        </div>
        <div class="tile-line dim">
          <span class="narrow clip" title={leaseKnown && holder ? stampFull(lease.message.since) : ""}>
            {!leaseKnown
              ? t("holder_unknown")
              : holder
                ? `${t("somebody", { name: holder })}, ${t("since", { time: stampWhen(lease.message.since) })}`
                : t("nobody")}
          </span>
        </div>
        {/* One line for each case, so that a tile's height never changes. */}
        <div class="tile-line">
          {problem ? (
            <p class={`tile-problem toned narrow clip small ${state.level}`} title={problem}>
              {problem}
            </p>
          ) : (
            <AliveServices of={robotKey} />
          )}
          {alarms.length > 0 && (
            <span class="tile-alarms rigid small gap-4" title={f("alarm_count", { count: alarms.length })}>
              <PriorityMark of={worst} />
              {alarms.length > 1 && ` ×${alarms.length}`}
            </span>
          )}
        </div>
      </div>
    </>
  );
}

/** The arm at its slow joint states, which are thinned for many subscribers and for remote robots. */
function Picture(props: { robotKey: string; description: Description | undefined; stale: boolean }) {
  const { robotKey, description } = props;
  const canvas = useRef<HTMLCanvasElement>(null);
  const [picture, setPicture] = useState<import("./tile-pictures").TilePicture | null>(null);
  const [drawable, setDrawable] = useState(true);
  const [last] = useState<{ newAt: number | null }>({ newAt: null });
  const kind = description && `${description.urdf.length} ${description.links.map((link) => link.meshSha256).join()}`;
  useEffect(() => {
    if (!description || !canvas.current) return;
    let end: (() => void) | undefined;
    let wanted = true;
    void import("./tile-pictures").then(({ tilePictures }) => {
      const pictures = tilePictures();
      setDrawable(pictures !== null);
      if (!pictures || !wanted || !canvas.current) return;
      const made = pictures.add(canvas.current, robotKey.slice(robotKey.indexOf("/") + 1), description);
      setPicture(made);
      const stop = watch(`${robotKey}/joints/slow`, (sample) => {
        last.newAt = sample.newAt;
        const { joints } = fromBinary(JointStatesSchema, sample.payload);
        const positions = new Map(joints.map((joint) => [joint.name, joint.position]));
        made.take(
          description.joints.map((joint) => positions.get(joint.name) ?? joint.home),
          sample.arrived,
        );
      });
      end = () => {
        stop();
        pictures.remove(made);
      };
    });
    return () => {
      wanted = false;
      end?.();
    };
  }, [robotKey, kind]);
  const at = now.value; // triggers drawing
  const age = last.newAt === null ? null : Math.max(0, (at - last.newAt) / 1000);
  const stale = props.stale || isStale("joints/slow", age, description);
  useEffect(() => picture?.setStale(stale), [picture, stale]);
  return (
    <div class={`tile-picture ${stale ? "stale" : ""}`} aria-hidden="true">
      {drawable ? <canvas ref={canvas} /> : <Silhouette label={t("no_picture")} />}
      {drawable && age === null && !props.stale && <span class="picture-word dim">{f("loading")}</span>}
    </div>
  );
}
