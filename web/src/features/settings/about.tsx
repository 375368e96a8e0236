// The product and its licence.

import { settingsText as s } from "../../i18n/texts";
import { Panel } from "../../ui/panel/panel";

export function About() {
  return (
    <Panel name="about" title={s("about")}>
      <p class="footnote">{s("about_words")}</p>
      <p class="footnote dim">{s("licence")}</p>
    </Panel>
  );
}
