// The page of alarms, events and audit entries of every robot and service of every site.

import { AlarmPanel } from "./alarm-panel";
import { Journal } from "./journal";
import "./events-page.css";

export function EventsPage() {
  return (
    <div class="events-page grid wide gap-8 pad-8">
      <AlarmPanel />
      <Journal />
    </div>
  );
}
