import "./styles"; // First, because the sheets that components import themselves must override these.
import "@preact/signals";
import { render } from "preact";
import { isolateTexts } from "../i18n/text-isolation";
import { showFirstLanguage } from "../i18n/texts";
import { fetchAccount, reportActivity, signedOut } from "../mesh/console/account";
import { keepConnected } from "../mesh/console/connection";
import { followThisTab } from "../mesh/control/control";
import { renewWhileBusy } from "../mesh/control/renewal";
import { applyTheme } from "../ui/page/theme";
import { App } from "./app";

isolateTexts();
applyTheme();
followThisTab();
renewWhileBusy();
const maySee = async () => {
  const who = await fetchAccount();
  return who && (!who.accounts || who.account !== "");
};
reportActivity(keepConnected(maySee, signedOut));
void showFirstLanguage().then(() => {
  const root = document.getElementById("app");
  if (root) render(<App />, root);
});
