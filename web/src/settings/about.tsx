// What this is, and under which terms.

import { Panel } from "../parts";
import { s } from "./texts";

export function About() {
  return (
    <Panel name="about" title={s("about")}>
      <p class="footnote">{s("about_words")}</p>
      <p class="footnote dim">{s("licence")}</p>
    </Panel>
  );
}
