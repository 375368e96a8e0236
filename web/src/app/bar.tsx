// The bar above every page: the same links, the robot that is shown, alarms, account, and STOP.

import type { ComponentChildren } from "preact";
import { useRef } from "preact/hooks";
import { AccountMenu } from "../features/account/account-menu";
import { AlarmBadge } from "../features/events/alarm-badge";
import { switchLanguage, t } from "../i18n/texts";
import { mustSignIn } from "../mesh/console/account";
import type { Route } from "../ui/page/route";
import { robotOf, route } from "../ui/page/route";
import { switchTheme, theme } from "../ui/page/theme";
import { useDismissal } from "../ui/panel/dismissal";
import { RobotSwitcher } from "./robot-switcher";

const PAGES = ["fleet", "wall", "recordings", "events", "define", "settings"] as const;

/** `children`: STOP, in the same place on every page. */
export function Bar({ children }: { children: ComponentChildren }) {
  const { page } = route.value;
  return (
    <header class="bar row gap-16 pad-0-16">
      <a class="brand row large bold tall-44 gap-8" href="#/" aria-label={`robomesh, ${t("fleet")}`}>
        <Mark />
        <span>robomesh</span>
      </a>
      {mustSignIn.value || (
        <>
          <nav class="page-links rigid flex nowrap gap-4" aria-label={t("pages")}>
            <PageLinks current={page} />
          </nav>
          <PageMenu current={page} />
          <Crumbs />
        </>
      )}
      <div class="bar-end rigid flex push">
        {mustSignIn.value || <AlarmBadge />}
        <AccountMenu />
        <button class="quiet in-settings" onClick={() => switchLanguage()} title={t("language_hint")}>
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
      {children}
    </header>
  );
}

function PageLinks({ current, chosen }: { current: Route["page"]; chosen?: () => void }) {
  return (
    <>
      {PAGES.map((page) => (
        <a
          key={page}
          href={page === "fleet" ? "#/" : `#/${page}`}
          aria-current={page === current ? "page" : undefined}
          onClick={chosen}
        >
          {t(page)}
        </a>
      ))}
    </>
  );
}

/** The links of a narrow bar; next to the button is the name of the current page. */
function PageMenu({ current }: { current: Route["page"] }) {
  const menu = useRef<HTMLDetailsElement>(null);
  const close = () => menu.current?.removeAttribute("open");
  useDismissal(menu, close);
  const name = current !== "robot" && !robotOf(route.value) ? t(current) : "";
  return (
    <details ref={menu} class="page-menu rigid">
      <summary aria-label={name ? `${t("pages")}: ${name}` : t("pages")}>
        <svg viewBox="0 0 24 24" width="24" height="24" aria-hidden="true">
          <path d="M4 7h16M4 12h16M4 17h16" />
        </svg>
        {name && <strong>{name}</strong>}
      </summary>
      <nav aria-label={t("pages")}>
        <PageLinks current={current} chosen={close} />
      </nav>
    </details>
  );
}

/** The site and the robot of the page, and the way to every other robot. */
function Crumbs() {
  const { page } = route.value;
  const robot = robotOf(route.value);
  return (
    <nav class={`crumbs row narrow nowrap dim gap-4 ${robot ? "" : "no-robot"}`} aria-label={t("crumbs")}>
      {robot && (
        <>
          <span class="crumb-site">{robot.site}</span>
          <span class="crumb-site" aria-hidden="true">
            /
          </span>
        </>
      )}
      <RobotSwitcher robot={robot} program={page === "program"} />
      {page === "program" && (
        <>
          <span class="crumb-page" aria-hidden="true">
            /
          </span>
          <strong class="crumb-page">{t("program")}</strong>
        </>
      )}
    </nav>
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
