// Frame of every page: links, alarms, banners, and STOP in a fixed place.

import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { SignIn } from "../features/account/sign-in";
import { FleetPage } from "../features/fleet/fleet-page";
import { ControllerStateSchema } from "../gen/robomesh_pb";
import { whenText } from "../i18n/format";
import type { TextName } from "../i18n/texts";
import { accountText as a, t } from "../i18n/texts";
import { mustSignIn } from "../mesh/console/account";
import { hello, lostAt, reachable } from "../mesh/console/connection";
import { controlNotice, heldLease, release } from "../mesh/control/control";
import { dismissStop, stop, stopAgain, stopNotice, unsentStop } from "../mesh/control/stop";
import { fleetRobots } from "../mesh/state/known-robots";
import { canBe, isReplay } from "../mesh/state/robot-name";
import { stopRequestText } from "../mesh/state/robot-state";
import { useTopic } from "../mesh/state/topics";
import { RobotNotFound } from "../panels/robot-not-found";
import { guardMovedControls } from "../ui/hold/moved-controls";
import { Button } from "../ui/inputs/button";
import { Warning } from "../ui/marks/warning";
import { type Route, robotOf, route } from "../ui/page/route";
import { NoticeLine } from "../ui/panel/notice-line";
import { Bar } from "./bar";

/** Return a component that loads its page when it is first shown. */
function onDemand<Props>(load: () => Promise<ComponentType<Props>>) {
  const loaded = signal<ComponentType<Props> | null>(null);
  const failed = signal(false);
  return function OnDemand(props: Props & object) {
    useEffect(() => {
      failed.value = false;
      if (!loaded.value)
        load().then(
          (page) => (loaded.value = page),
          () => (failed.value = true),
        );
    }, []);
    const Page = loaded.value;
    return Page ? <Page {...props} /> : failed.value && <NotLoaded />;
  };
}

/** The message for a page that cannot be loaded, because a newer console no longer has its files. */
function NotLoaded() {
  return (
    <div class="empty" role="alert">
      <p>{t("page_not_loaded")}</p>
      <Button text={t("load_again")} onClick={() => location.reload()} />
    </div>
  );
}

// The robot's page needs three.js; the fleet's text must not wait for it.
const RobotPage = onDemand(async () => (await import("../features/robot/robot-page")).RobotPage);
const ReplayRobotPage = onDemand(
  async () => (await import("../features/recordings/player/replay-robot-page")).ReplayRobotPage,
);
const ProgramPage = onDemand(async () => (await import("../features/program/program-page")).ProgramPage);
const CellPage = onDemand(async () => (await import("../features/cell/cell-page")).CellPage);
const DefinePage = onDemand(async () => (await import("../features/define/define-page")).DefinePage);
const WallPage = onDemand(async () => (await import("../features/wall/wall-page")).WallPage);
const RecordingsPage = onDemand(async () => (await import("../features/recordings/recordings-page")).RecordingsPage);
const EventsPage = onDemand(async () => (await import("../features/events/events-page")).EventsPage);
const SettingsPage = onDemand(async () => (await import("../features/settings/settings-page")).SettingsPage);

export function App() {
  const shown = route.value;
  const robot = robotOf(shown);
  const notFound = robot !== null && !canBe(robot);
  const key = robot && !notFound ? `robomesh/${robot.site}/${robot.robot}` : null;
  const replay = robot !== null && isReplay(robot.robot);
  // Keep control between a robot's pages, release it when leaving them.
  useEffect(() => () => void release(), [key]);
  const page = shown.page === "fleet" || shown.page === "robot" ? "" : t(shown.page);
  const title = [notFound ? "" : robot?.robot, page, "robomesh"].filter(Boolean).join(" · ");
  useEffect(() => void (document.title = title), [title]);
  useStopKey();
  useEffect(() => guardMovedControls(() => (controlNotice.value = { kind: "refused", text: t("just_moved") })), []);
  // A replay has nothing to stop: STOP stays with the live robots.
  const robots = key && !replay ? [key] : fleetRobots.value;
  return (
    <>
      <SkipLink />
      <Bar>
        <StopPlace robots={mustSignIn.value ? [] : robots} />
      </Bar>
      <Banners />
      <main id="page" tabIndex={-1} lang={t("language_tag")}>
        {mustSignIn.value ? (
          <SignIn />
        ) : robot && notFound ? (
          <RobotNotFound {...robot} />
        ) : (
          <Page route={shown} robotKey={key ?? ""} />
        )}
      </main>
    </>
  );
}

/** The first stop of the Tab key: past the bar, to the page. Not a link: a hash is another page here. */
function SkipLink() {
  return (
    <button class="skip-link row tall-44 pad-0-16" onClick={() => document.getElementById("page")?.focus()}>
      {t("skip")}
    </button>
  );
}

function Page({ route, robotKey }: { route: Route; robotKey: string }) {
  switch (route.page) {
    case "robot":
      return isReplay(route.robot.robot) ? (
        <ReplayRobotPage key={robotKey} {...route.robot} />
      ) : (
        <RobotPage key={robotKey} {...route.robot} />
      );
    case "program":
      return <ProgramPage shown={route.robot} sha256={route.sha256} />;
    case "cell":
      return <CellPage key={robotKey} {...route.robot} />;
    case "define":
      return <DefinePage name={route.name} />;
    case "wall":
      return <WallPage chosen={route.views} />;
    case "recordings":
      return <RecordingsPage shown={route.recordings} />;
    case "events":
      return <EventsPage />;
    case "settings":
      return <SettingsPage />;
    case "fleet":
      return <FleetPage />;
  }
}

function StopPlace({ robots }: { robots: readonly string[] }) {
  const named = robotOf(route.value);
  const robot = named && canBe(named) && !isReplay(named.robot) ? named.robot : "";
  return (
    <div class="stop-place row narrow anchor gap-16">
      {stopNotice.value && (
        <div class={`stop-notice row card pad-8 ${stopNotice.value.kind}`}>
          <NoticeLine notice={stopNotice.value} />
          {unsentStop.value && reachable.value && <Button text={t("stop_again")} onClick={stopAgain} />}
          <Button quiet text={t("dismiss")} onClick={dismissStop} />
        </div>
      )}
      {robot && robots[0] ? (
        <RobotStop robot={robot} robotKey={robots[0]} />
      ) : (
        <StopButton robots={robots} text={robot ? "stop" : "stop_all"} hint={t("stop_all_hint")} />
      )}
    </div>
  );
}

function RobotStop({ robot, robotKey }: { robot: string; robotKey: string }) {
  const text = stopRequestText(useTopic(ControllerStateSchema, `${robotKey}/controller`));
  return <StopButton robots={[robotKey]} text={text} hint={t(`${text}_hint`, { robot })} />;
}

/** It can always be pressed, also where its request does not arrive now: then it says so. */
function StopButton(props: { robots: readonly string[]; text: TextName; hint: string }) {
  const { robots } = props;
  const text = reachable.value ? props.text : "stop_unreachable";
  const arrives = text === "stop" || text === "stop_all" || text === "stop_ours";
  return (
    <button
      class={`stop row rigid large gap-12 ${arrives ? "" : "unreachable"} ${text === "stop_none" ? "none" : ""}`}
      disabled={robots.length === 0}
      onClick={() => void stop(robots)}
      title={mustSignIn.value ? a("no_stop") : props.hint}
    >
      <span class="stop-shape" aria-hidden="true" />
      <span>{t(text)}</span>
      {arrives && heldLease.value && <kbd>{t("stop_space")}</kbd>}
    </button>
  );
}

/** Request a stop on Space while this tab is in control, except while the operator types. */
function useStopKey(): void {
  useEffect(() => {
    const isTyping = (target: EventTarget | null) =>
      target instanceof HTMLTextAreaElement ||
      (target instanceof HTMLInputElement && ["text", "search", "password"].includes(target.type));
    const onKey = (event: KeyboardEvent) => {
      const mine = heldLease.value;
      if (event.code !== "Space" || !mine || isTyping(event.target)) return;
      event.preventDefault(); // nor press the focused button
      event.stopPropagation();
      if (event.type === "keydown" && !event.repeat) void stop([mine.robotKey]);
    };
    addEventListener("keydown", onKey, true);
    addEventListener("keyup", onKey, true);
    return () => {
      removeEventListener("keydown", onKey, true);
      removeEventListener("keyup", onKey, true);
    };
  }, []);
}

function Banners() {
  const lost = lostAt.value;
  if (mustSignIn.value) return null; // the sign-in page says it
  return (
    <>
      {/* Over the page: their appearance must not move a control. */}
      <div class="over-page banners">
        {lost === 0 && <div class="banner">{t("connecting")}</div>}
        {lost !== null && lost > 0 && (
          <Warning as="div" class="banner warning" role="alert" text={t("reconnecting", { time: whenText(lost) })} />
        )}
        {lost === null && hello.value?.connected === false && (
          <Warning as="div" class="banner warning" role="alert" text={t("router_lost")} />
        )}
      </div>
      {hello.value?.insecure && (
        <Warning as="div" class="banner warning" text={hello.value.account ? a("insecure_signed_in") : t("insecure")} />
      )}
    </>
  );
}
