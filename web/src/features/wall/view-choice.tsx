// Choice of the wall's pictures: a row a robot, a button a view.

import { viewText, wallText as w } from "../../i18n/texts";
import { Button } from "../../ui/inputs/button";
import { Toggle } from "../../ui/inputs/choice";
import type { ViewName } from "../../ui/page/route";

export interface RobotViews {
  site: string;
  robot: string;
  views: readonly string[];
}

export function ViewChoice(props: {
  robots: readonly RobotViews[];
  shown: readonly ViewName[];
  show: (shown: readonly ViewName[]) => void;
}) {
  const { robots, shown, show } = props;
  const is = (one: ViewName) => (other: ViewName) =>
    one.site === other.site && one.robot === other.robot && one.view === other.view;
  const set = (one: ViewName, on: boolean) => show(on ? [...shown, one] : shown.filter((other) => !is(one)(other)));
  const every = [...new Set(robots.flatMap((robot) => robot.views))];
  return (
    <div class="wall-choose rigid scroll gap-8 pad-8-16 panel">
      <div class="wall-every row wrap gap-4-8">
        <span class="dim">{w("every")}</span>
        {every.map((view) => (
          <Button
            key={view}
            text={viewText(view)}
            onClick={() =>
              show(robots.flatMap(({ site, robot, views }) => (views.includes(view) ? [{ site, robot, view }] : [])))
            }
          />
        ))}
      </div>
      <div class="wall-robots grid gap-8-24">
        {robots.map(({ site, robot, views }) => (
          <div key={`${site}/${robot}`} class="row wrap gap-4-8" role="group" aria-label={`${site}/${robot}`}>
            <span class="wall-robot-name">
              <span class="dim">{site}/</span>
              {robot}
            </span>
            {views.map((view) => {
              const one = { site, robot, view };
              return <Toggle text={viewText(view)} key={view} on={shown.some(is(one))} set={(on) => set(one, on)} />;
            })}
          </div>
        ))}
      </div>
      <p class="footnote dim">{w("chosen_kept")}</p>
    </div>
  );
}
