// The text's points: show with the ghost, rename, delete.

import { useState } from "preact/hooks";
import type { Words } from "../../../i18n/texts";
import { programText as p } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { draft, goToLine, replace } from "../draft/draft";
import type { Point } from "../draft/program-text";
import { isName, jointsOf, pointsOf, removeLine, renamePoint, usesOf } from "../draft/program-text";
import { description, livePositions } from "../motion/program-robot";
import { teach } from "../motion/scene-overlay";
import { poseOf, taughtPositions, teachPose } from "../motion/taught-pose";

export function PointList({ tell }: { tell: (words: Words) => void }) {
  const text = draft.value?.text ?? "";
  const points = pointsOf(text);
  const [naming, setNaming] = useState<string | null>(null);
  const rename = (point: Point, to: string) => {
    setNaming(null);
    if (to === point.name) return;
    if (!isName(to)) return tell(() => p("name_wrong", { name: to }));
    if (points.some((each) => each.name === to)) return tell(() => p("name_taken", { name: to }));
    replace(renamePoint(text, point.name, to), point.line);
  };
  const remove = (point: Point) => {
    const uses = usesOf(text, point.name);
    replace(removeLine(text, point.line), Math.max(1, point.line - 1));
    const lines = uses.map((line) => line - (line > point.line ? 1 : 0)).join(", ");
    tell(() => (uses.length ? p("deleted_used", { name: point.name, lines }) : p("deleted", { name: point.name })));
  };
  if (points.length === 0) return <p class="pad-0-16 dim">{p("no_points")}</p>;
  return (
    <ul class="points pad-0-16" aria-label={p("points")}>
      {points.map((point) => (
        <li key={`${point.line} ${point.name}`}>
          {naming === point.name ? (
            <input
              type="text"
              class="point-name"
              aria-label={p("rename_point", { name: point.name })}
              autocomplete="off"
              spellcheck={false}
              maxLength={40}
              ref={(field) => field?.focus()}
              defaultValue={point.name}
              onBlur={(event) => rename(point, event.currentTarget.value.trim())}
              onKeyDown={(event) => {
                if (event.key === "Enter") rename(point, event.currentTarget.value.trim());
                else if (event.key === "Escape") setNaming(null);
              }}
            />
          ) : (
            <button
              class="point-name quiet"
              title={p("rename_point", { name: point.name })}
              aria-label={p("rename_point", { name: point.name })}
              onClick={() => setNaming(point.name)}
            >
              {point.name}
            </button>
          )}
          <span class="clip dim small" title={point.numbers.join(" ")}>
            {p(`by_${point.kind}`)} {point.numbers.join(" ")}
          </span>
          <Button
            quiet
            text={p("go_to")}
            aria-label={p("go_to_point", { name: point.name })}
            onClick={() => goTo(point, tell)}
          />
          <Button
            quiet
            text={p("delete")}
            aria-label={p("delete_of", { name: point.name })}
            onClick={() => remove(point)}
          />
        </li>
      ))}
    </ul>
  );
}

/** Show a point with the ghost, as a start for teaching. */
function goTo(point: Point, tell: (words: Words) => void): void {
  goToLine(point.line);
  const joints = description.value?.joints ?? [];
  if (point.kind === "joints") {
    const positions = jointsOf(joints, point);
    if (positions) teach(positions);
    else tell(() => p("point_wrong", { name: point.name, count: joints.length }));
    return;
  }
  const from = taughtPositions.value ?? livePositions.value ?? joints.map((joint) => joint.home);
  teach(from);
  teachPose(poseOf(point.numbers));
}
