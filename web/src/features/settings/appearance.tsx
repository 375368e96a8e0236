// Language and theme, kept in this browser only.

import { s } from "../../i18n/settings";
import { language, switchLanguage } from "../../i18n/texts";
import { setSound, sound } from "../../panels/alarm-sound";
import { Choice } from "../../ui/choice";
import { Panel } from "../../ui/panel";
import { switchTheme, theme } from "../../ui/theme";
import { Facts } from "./facts";

const LANGUAGES = { en: "English", zh: "中文" } as const;

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
              values={["en", "zh"] as const}
              chosen={language.value}
              text={(name) => LANGUAGES[name]}
              choose={(name) => name !== language.value && switchLanguage()}
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
