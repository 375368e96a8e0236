import "@preact/signals";
import { render } from "preact";
import { followPerson, signedOut, whoAmI } from "./account/account";
import { App } from "./app";
import { followThisTab } from "./control";
import { isolateForeignTexts } from "./foreign-text";
import { keepConnected } from "./mesh";
import { language } from "./texts";
import { applyTheme } from "./theme";
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
