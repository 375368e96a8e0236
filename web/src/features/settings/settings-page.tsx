// The settings page: health of the mesh, presence, this browser, and the console's accounts.

import { me } from "../../mesh/account";
import { hello } from "../../mesh/connection";
import { About } from "./about";
import { Accounts } from "./accounts";
import { Certificates } from "./certificates";
import { Look } from "./appearance";
import { MeshPanel } from "./mesh-panel";
import { Presence } from "./attached-clients";
import { Sessions } from "./sessions";
import { ThisConsole } from "./this-console";
import "./settings-page.css";

export function Settings() {
  return (
    <div class="settings-page">
      <ThisConsole hello={hello.value} />
      <Look />
      <MeshPanel />
      <Presence />
      <Certificates />
      {me.value?.account && <Sessions />}
      {me.value?.role === "admin" && <Accounts />}
      <About />
    </div>
  );
}
