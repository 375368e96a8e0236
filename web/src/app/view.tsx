// Entry of the page of one view: `/view/<site>/<robot>/<view>`, `?theme=dark|light`, `?language=en|zh`.

import "@preact/signals";
import { render } from "preact";
import { ViewPage } from "../features/view/view-page";
import { isolateTexts } from "../i18n/text-isolation";
import { isLanguage, showFirstLanguage } from "../i18n/texts";
import { followView } from "../mesh/console/view-stream";
import { applyTheme, theme } from "../ui/page/theme";
import "../ui/tokens.css";
import "./base.css";
import "../ui/marks/state.css";
import "../ui/marks/replay.css";
import "../features/view/view-page.css";

const query = new URLSearchParams(location.search);
const [, , site = "", robot = "", view = ""] = location.pathname.split("/");
const wantedTheme = query.get("theme");
const wantedLanguage = query.get("language");
if (wantedTheme === "dark" || wantedTheme === "light") theme.value = wantedTheme;
isolateTexts();
applyTheme();
const token = query.get("token");
followView(`${location.pathname}/live${token ? `?${new URLSearchParams({ token })}` : ""}`);
void showFirstLanguage(isLanguage(wantedLanguage) ? wantedLanguage : undefined).then(() => {
  const root = document.getElementById("view");
  if (root) render(<ViewPage site={site} robot={robot} view={view} />, root);
});
