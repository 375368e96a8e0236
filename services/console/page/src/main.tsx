import "@preact/signals";
import { render } from "preact";
import { App } from "./app";
import { releaseWhenHidden } from "./control";
import { connect } from "./mesh";
import { language } from "./texts";
import { applyTheme } from "./theme";
import "./style.css";

applyTheme();
document.documentElement.lang = language.value === "zh" ? "zh-Hans" : "en";
releaseWhenHidden();
connect();
const root = document.getElementById("app");
if (root) render(<App />, root);
