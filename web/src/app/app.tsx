// Frame of every page: links, alarms, banners, and STOP in a fixed place.

import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect, useRef } from "preact/hooks";
import { AccountMenu } from "../features/account/account-menu";
import { SignIn } from "../features/account/sign-in";
import { AlarmBadge } from "../features/events/alarm-badge";
import { FleetPage } from "../features/fleet/fleet-page";
import { a } from "../i18n/account";
import { timeOfDay } from "../i18n/format";
import { language, switchLanguage, t } from "../i18n/texts";
import { mustSignIn } from "../mesh/account";
import { hello, lostAt, reachable } from "../mesh/connection";
import { controlNotice, heldLease, release } from "../mesh/control";
import { fleetRobots } from "../mesh/known-robots";
import type { RobotName } from "../mesh/robot-name";
import { canBe, isReplay } from "../mesh/robot-name";
import { dismissStop, stop, stopAgain, stopNotice, unsentStop } from "../mesh/stop";
import { RobotNotFound } from "../panels/robot-not-found";
import { guardMovedControls } from "../ui/moved-controls";
import { NoticeLine } from "../ui/notice-line";
import { type Route, robotLink, robotOf, route } from "../ui/route";
import { switchTheme, theme } from "../ui/theme";

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

/** The message for a page whose files a newer console no longer has. */
function NotLoaded() {
  return (
    <div class="empty" role="alert">
      <p>{t("page_not_loaded")}</p>
      <button class="action" onClick={() => location.reload()}>
        {t("load_again")}
      </button>
    </div>
  );
}

// The robot's page needs three.js; the fleet's text must not wait for it.
const RobotPage = onDemand(async () => (await import("../features/robot/robot-page")).RobotPage);
const ReplayRobotPage = onDemand(
  async () => (await import("../features/recordings/replay-robot-page")).ReplayRobotPage,
);
const ProgramPage = onDemand(async () => (await import("../features/program/program-page")).ProgramPage);
const DefinePage = onDemand(async () => (await import("../features/define/define-page")).DefinePage);
const WallPage = onDemand(async () => (await import("../features/wall/wall-page")).WallPage);
const RecordingsPage = onDemand(async () => (await import("../features/recordings/recordings-page")).RecordingsPage);
const EventsPage = onDemand(async () => (await import("../features/events/events-page")).EventsPage);
const SettingsPage = onDemand(async () => (await import("../features/settings/settings-page")).SettingsPage);

const PAGES = ["fleet", "wall", "recordings", "define", "events", "settings"] as const;
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
      <header class="bar">
        <a class="brand" href="#/" aria-label={`robomesh, ${t("fleet")}`}>
          <Mark />
          <span>robomesh</span>
        </a>
        <nav class="crumbs" aria-label={t("pages")}>
          {mustSignIn.value ? null : robot || shown.page === "program" ? (
            <Crumbs page={shown.page} robot={robot} />
          ) : (
            <PageLinks current={shown.page} />
          )}
        </nav>
        <div class="bar-end">
          {mustSignIn.value || <AlarmBadge />}
          <AccountMenu />
          <button class="quiet in-settings" onClick={switchLanguage} title={t("language_hint")}>
            {t("language")}
          </button>
          <button
            class="quiet in-settings"
            onClick={switchTheme}
            title={t("theme_hint", { theme: t(theme.value === "dark" ? "theme_dark" : "theme_light") })}
          >
            {t(theme.value === "dark" ? "theme_light" : "theme_dark")}
          </button>
        </div>
        <StopButton robots={mustSignIn.value ? [] : robots} />
      </header>
      <Banners />
      <main lang={language.value === "zh" ? "zh-Hans" : "en"}>
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

function Page({ route, robotKey }: { route: Route; robotKey: string }) {
  switch (route.page) {
    case "robot":
      return isReplay(route.robot.robot) ? (
        <ReplayRobotPage key={robotKey} {...route.robot} />
      ) : (
        <RobotPage key={robotKey} {...route.robot} />
      );
    case "program":
      return <ProgramPage shown={route.robot} />;
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

/** The way to a robot's page or its program; without a robot, to the choice of one to program. */
function Crumbs({ page, robot }: { page: Route["page"]; robot: RobotName | null }) {
  const program = page === "program";
  return (
    <>
      <a href="#/">{t("fleet")}</a>
      <span aria-hidden="true">/</span>
      {robot && (
        <>
          <span class="dim">{robot.site}</span>
          <span aria-hidden="true">/</span>
          {program ? <a href={robotLink(robot.site, robot.robot)}>{robot.robot}</a> : <strong>{robot.robot}</strong>}
          {program && <span aria-hidden="true">/</span>}
        </>
      )}
      {program && <strong>{t("program")}</strong>}
    </>
  );
}

/** Links to the pages in a row; on a narrow screen, in a menu with the name of the current page. */
function PageLinks({ current }: { current: Route["page"] }) {
  const menu = useRef<HTMLDetailsElement>(null);
  const close = () => menu.current?.removeAttribute("open");
  const links = () =>
    PAGES.map((page) => (
      <a
        key={page}
        href={page === "fleet" ? "#/" : `#/${page}`}
        aria-current={page === current ? "page" : undefined}
        onClick={close}
      >
        {t(page)}
      </a>
    ));
  return (
    <>
      <span class="page-links">{links()}</span>
      <details ref={menu} class="page-menu" onKeyDown={(event) => event.key === "Escape" && close()}>
        <summary>{t(current === "robot" ? "fleet" : current)}</summary>
        <div>{links()}</div>
      </details>
    </>
  );
}

function StopButton({ robots }: { robots: readonly string[] }) {
  const named = robotOf(route.value);
  const robot = named && canBe(named) && !isReplay(named.robot) ? named.robot : "";
  const one = robot !== "";
  return (
    <div class="stop-place">
      {stopNotice.value && (
        <div class={`stop-notice ${stopNotice.value.kind}`}>
          <NoticeLine notice={stopNotice.value} />
          {unsentStop.value && reachable.value && (
            <button class="action" onClick={stopAgain}>
              {t("stop_again")}
            </button>
          )}
          <button class="quiet" onClick={dismissStop}>
            {t("dismiss")}
          </button>
        </div>
      )}
      <button
        class={`stop ${reachable.value ? "" : "unreachable"}`}
        disabled={robots.length === 0}
        onClick={() => void stop(robots)}
        title={mustSignIn.value ? a("no_stop") : one ? t("stop_hint", { robot }) : t("stop_all_hint")}
      >
        <span class="stop-shape" aria-hidden="true" />
        <span>{t(!reachable.value ? "stop_unreachable" : one ? "stop" : "stop_all")}</span>
        {reachable.value && heldLease.value && <kbd>{t("stop_space")}</kbd>}
      </button>
    </div>
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
        {lost === 0 && <div class="banner connecting">{t("connecting")}</div>}
        {lost !== null && lost > 0 && (
          <div class="banner warning" role="alert">
            <span class="shape warning" aria-hidden="true" />
            {t("reconnecting", { time: timeOfDay(lost) })}
          </div>
        )}
        {lost === null && hello.value?.connected === false && (
          <div class="banner warning" role="alert">
            <span class="shape warning" aria-hidden="true" />
            {t("router_lost")}
          </div>
        )}
      </div>
      {hello.value?.insecure && (
        <div class="banner warning">
          <span class="shape warning" aria-hidden="true" />
          {hello.value.account ? a("insecure_signed_in") : t("insecure")}
        </div>
      )}
    </>
  );
}

function Mark() {
  return (
    <svg viewBox="0 0 32 32" width="28" height="28" aria-hidden="true">
      <path class="mark-arm" d="M6 27h12M10 27V17l9-8 7 5" />
      <circle class="mark-joint" cx="10" cy="17" r="3" />
      <circle class="mark-joint" cx="19" cy="9" r="3" />
    </svg>
  );
}
