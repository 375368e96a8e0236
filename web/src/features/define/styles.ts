// Style sheets of Define, in the order of the cascade: a later sheet overrides an earlier one.

import "../../ui/robot-cards.css";
import "./define-page.css";
import "./panels/toolbar.css";
import "./opening/missing-files.css";
import "./opening/new-robot.css";
import "./panels/kinematic-chain.css";
import "./panels/problems-panel.css";
import "./scene/scene-panel.css";
import "./panels/positions-panel.css";
import "./draft/fields.css";
import "./table/dh-table.css";
import "./table/paste-table.css";
import "./tabs.css";
import "./panels/part-details.css";
import "./panels/collisions-tab.css";
import "./panels/views-tab.css";
import "./breakpoints.css";
