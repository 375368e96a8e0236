import "./styles"; // first: what a component imports besides overrides it
import "@preact/signals";
import { render } from "preact";
import { isolateTexts } from "../i18n/text-isolation";
import { showLanguage } from "../i18n/texts";
import { fetchAccount, reportActivity, signedOut } from "../mesh/console/account";
import { keepConnected } from "../mesh/console/connection";
import { followThisTab } from "../mesh/control/control";
import { renewWhileBusy } from "../mesh/control/renewal";
import { applyTheme } from "../ui/theme";
import { App } from "./app";

isolateTexts();
applyTheme();
void showLanguage().then(start);

function start(): void {
  followThisTab();
  renewWhileBusy();
  const maySee = async () => {
    const who = await fetchAccount();
    return who && (!who.accounts || who.account !== "");
  };
  reportActivity(keepConnected(maySee, signedOut));
  const root = document.getElementById("app");
  if (root) render(<App />, root);
}
