// What is on every screen: where one is, what is wrong, and STOP, always in the same place.

import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { held, release, stop, stopNotice } from "./control";
import { Fleet, fleetRobots } from "./fleet";
import { timeOfDay } from "./format";
import { hello, lostAt } from "./mesh";
import { NoticeLine } from "./parts";
import { route } from "./route";
import type { RobotName } from "./route";
import { language, switchLanguage, t } from "./texts";
import { switchTheme, theme } from "./theme";

// The robot's page brings three.js: the fleet does not wait for it.
const robotPage = signal<ComponentType<RobotName> | null>(null);

export function App() {
  const shown = route.value;
  const key = shown ? `robomesh/${shown.site}/${shown.robot}` : null;
  useEffect(() => {
    document.title = shown ? `${shown.robot} · robomesh` : "robomesh";
    if (shown && !robotPage.value) void import("./robot").then((module) => (robotPage.value = module.Robot));
    return () => void release(); // control does not outlive the page it was taken on
  }, [key]);
  useStopKey();
  const Robot = robotPage.value;
  const robots = key ? [key] : fleetRobots.value;
  return (
    <>
      <header class="bar">
        <a class="brand" href="#/" aria-label={`robomesh, ${t("fleet")}`}>
          <Mark />
          <span>robomesh</span>
        </a>
        <nav class="crumbs" aria-label={t("site")}>
          {shown ? (
            <>
              <a href="#/">{t("fleet")}</a>
              <span aria-hidden="true">/</span>
              <span class="dim">{shown.site}</span>
              <span aria-hidden="true">/</span>
              <strong>{shown.robot}</strong>
            </>
          ) : (
            <strong>{t("fleet")}</strong>
          )}
        </nav>
        <div class="bar-end">
          <button class="quiet" onClick={switchLanguage} title={t("language_hint")}>
            {t("language")}
          </button>
          <button
            class="quiet"
            onClick={switchTheme}
            title={t("theme_hint", { theme: t(theme.value === "dark" ? "theme_dark" : "theme_light") })}
          >
            {t(theme.value === "dark" ? "theme_light" : "theme_dark")}
          </button>
        </div>
        <StopButton robots={robots} />
      </header>
      <Banners />
      <main lang={language.value === "zh" ? "zh-Hans" : "en"}>
        {shown ? Robot && <Robot key={key ?? ""} {...shown} /> : <Fleet />}
      </main>
    </>
  );
}

function StopButton({ robots }: { robots: readonly string[] }) {
  const one = route.value !== null;
  const robot = route.value?.robot ?? "";
  return (
    <div class="stop-place">
      {stopNotice.value && (
        <div class={`stop-notice ${stopNotice.value.kind}`}>
          <NoticeLine notice={stopNotice.value} />
          <button class="quiet" onClick={() => (stopNotice.value = null)}>
            {t("dismiss")}
          </button>
        </div>
      )}
      <button
        class="stop"
        disabled={robots.length === 0}
        onClick={() => void stop(robots)}
        title={one ? t("stop_hint", { robot }) : t("stop_all_hint")}
      >
        <span class="stop-shape" aria-hidden="true" />
        <span>{t(one ? "stop" : "stop_all")}</span>
        {held.value && <kbd>{t("stop_space")}</kbd>}
      </button>
    </div>
  );
}

/** Space asks for a stop while this tab is in control, wherever the focus is, typing excepted. */
function useStopKey(): void {
  useEffect(() => {
    const isTyping = (target: EventTarget | null) =>
      target instanceof HTMLInputElement && ["text", "search"].includes(target.type);
    const onKey = (event: KeyboardEvent) => {
      const mine = held.value;
      if (event.code !== "Space" || !mine || isTyping(event.target)) return;
      event.preventDefault(); // nor does it press the button that has the focus
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
  return (
    <div class="banners">
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
      {hello.value?.insecure && (
        <div class="banner warning">
          <span class="shape warning" aria-hidden="true" />
          {t("insecure")}
        </div>
      )}
    </div>
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
