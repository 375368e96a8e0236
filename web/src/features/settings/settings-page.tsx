// The settings page: health of the mesh, presence, this browser, and the console's accounts.

import { t } from "../../i18n/texts";
import { me } from "../../mesh/console/account";
import { hello } from "../../mesh/console/connection";
import { About } from "./about";
import { Accounts } from "./accounts";
import { Appearance } from "./appearance";
import { AttachedClients } from "./attached-clients";
import { Certificates } from "./certificates";
import { MeshPanel } from "./mesh-panel";
import { Sessions } from "./sessions";
import { ThisConsole } from "./this-console";
import "./settings-page.css";

export function SettingsPage() {
  return (
    <div class="settings-page grid wide gap-8">
      <h1 class="unseen">{t("settings")}</h1>
      <ThisConsole hello={hello.value} />
      <Appearance />
      <MeshPanel />
      <AttachedClients />
      <Certificates />
      {me.value?.account && <Sessions />}
      {me.value?.role === "admin" && <Accounts />}
      <About />
    </div>
  );
}
