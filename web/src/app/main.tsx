import "@preact/signals";
import { render } from "preact";
import { followPerson, signedOut, whoAmI } from "../mesh/account";
import { App } from "./app";
import { followThisTab } from "../mesh/control";
import { isolateForeignTexts } from "../i18n/foreign-text";
import { keepConnected } from "../mesh/connection";
import { language } from "../i18n/texts";
import { applyTheme } from "../ui/theme";
import "./style.css";

isolateForeignTexts();
applyTheme();
document.documentElement.lang = language.value === "zh" ? "zh-Hans" : "en";
followThisTab();
const maySee = async () => {
  const who = await whoAmI();
  return who && (!who.accounts || who.account !== "");
};
followPerson(keepConnected(maySee, signedOut));
const root = document.getElementById("app");
if (root) render(<App />, root);
