// A curve's colour and dash in a legend.

import { curveColour } from "./plot-appearance";

export function CurveMark({ index, dash = "" }: { index: number; dash?: "" | "dashed" | "dotted" | undefined }) {
  return <span class={`curve ${dash}`} style={{ background: `var(${curveColour(index)})` }} aria-hidden="true" />;
}
