// Language and theme, kept in this browser only.

import { LANGUAGES, language, languageName, settingsText as s, switchLanguage } from "../../i18n/texts";
import { setSound, sound } from "../../panels/alarm-sound";
import { Choice } from "../../ui/inputs/choice";
import { switchTheme, theme } from "../../ui/page/theme";
import { Panel } from "../../ui/panel/panel";
import { Facts } from "./facts";

export function Appearance() {
  return (
    <Panel name="look" title={s("look")}>
      <Facts
        of={[
          [
            s("language"),
            <Choice
              key="language"
              label={s("language")}
              values={LANGUAGES}
              chosen={language.value}
              text={languageName}
              choose={switchLanguage}
            />,
          ],
          [
            s("theme"),
            <Choice
              key="theme"
              label={s("theme")}
              values={["dark", "light"] as const}
              chosen={theme.value}
              text={(name) => s(`theme_${name}`)}
              choose={(name) => name !== theme.value && switchTheme()}
            />,
          ],
          [
            s("alarm_tone"),
            <Choice
              key="sound"
              label={s("alarm_tone")}
              values={["on", "off"] as const}
              chosen={sound.value ? "on" : "off"}
              text={s}
              choose={(name) => setSound(name === "on")}
            />,
          ],
          [s("units"), s("units_words")],
        ]}
      />
    </Panel>
  );
}
