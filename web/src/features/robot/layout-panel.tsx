// Layout of the robot's page: in the address, so that a link opens the same on another machine.

import { signal } from "@preact/signals";
import { useMemo, useState } from "preact/hooks";
import { plotsText as p } from "../../i18n/texts";
import { Button } from "../../ui/inputs/button";
import { Warning } from "../../ui/marks/warning";
import type { Layout, LayoutProblem } from "../../ui/page/layout";
import { DEFAULT_LAYOUT, layoutText, PANELS, readLayout } from "../../ui/page/layout";
import { layoutQuery, setLayoutQuery } from "../../ui/page/route";
import { SavedLayouts } from "./saved-layouts";
import "./layout-panel.css";

/** Whether the panel is open, for all robots. */
const shown = signal(false);

export interface LayoutState {
  layout: Layout;
  problem: LayoutProblem | null;
  change: (changed: Partial<Layout>) => void;
}

/** Return the layout in the address, which a change rewrites. */
export function useLayout(): LayoutState {
  const query = layoutQuery.value;
  const read = useMemo(() => readLayout(query), [query]);
  const change = (changed: Partial<Layout>) =>
    setLayoutQuery(layoutText({ ...readLayout(layoutQuery.peek()).layout, ...changed }));
  return { ...read, change };
}

/** Return the classes of the page's grid. */
export function layoutClasses({ place, hidden }: Layout): string {
  const video = hidden.includes("video") ? "no-video" : `video-${place}`;
  return hidden.includes("plots") ? `${video} no-plots` : video;
}

export function LayoutButton() {
  return (
    <button
      class="note-button"
      aria-expanded={shown.value}
      title={p("layout_hint")}
      onClick={() => (shown.value = !shown.value)}
    >
      {p("layout_open")}
    </button>
  );
}

export function LayoutPanel(props: LayoutState & { site: string }) {
  const { layout, problem, change } = props;
  const [told, setTold] = useState(false);
  if (!shown.value && !problem) return null;
  const copy = () =>
    navigator.clipboard?.writeText(location.href).then(
      () => setTold(true),
      () => setTold(false),
    );
  return (
    <section class="panel layout-panel" aria-label={p("layout")}>
      {problem && (
        <div class="layout-row row wrap gap-8-16 pad-8-16">
          <Warning
            class="layout-problem break warned"
            role="alert"
            text={p("layout_wrong", { why: p(problem.text, problem.values) })}
          />
          <Button text={p("layout_reset")} onClick={() => setLayoutQuery("")} />
        </div>
      )}
      {shown.value && (
        <div class="layout-row row wrap gap-8-16 pad-8-16">
          {PANELS.map((each) => (
            <label key={each} class="row tall-32 gap-8">
              <input
                type="checkbox"
                checked={!layout.hidden.includes(each)}
                onChange={(event) =>
                  change({
                    hidden: event.currentTarget.checked
                      ? layout.hidden.filter((other) => other !== each)
                      : PANELS.filter((other) => other === each || layout.hidden.includes(other)),
                  })
                }
              />
              {p(each === "video" ? "panel_video" : "panel_plots")}
            </label>
          ))}
          {navigator.clipboard && <Button text={p(told ? "copied" : "copy_link")} onClick={() => void copy()} />}
          {!problem && (
            <Button
              text={p("layout_reset")}
              disabled={layoutText(layout) === layoutText(DEFAULT_LAYOUT)}
              onClick={() => setLayoutQuery("")}
            />
          )}
          <button class="quiet push" onClick={() => (shown.value = false)}>
            {p("close")}
          </button>
        </div>
      )}
      {shown.value && <SavedLayouts site={props.site} text={layoutText(layout)} />}
    </section>
  );
}
