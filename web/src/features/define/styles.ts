// Style sheets of Define, in the order of the cascade: a later sheet overrides an earlier one.

import "./define-page.css";
import "./toolbar.css";
import "./missing-files.css";
import "./new-robot.css";
import "./kinematic-chain.css";
import "./problems-panel.css";
import "./scene-panel.css";
import "./positions-panel.css";
import "./fields.css";
import "./dh-table.css";
import "./paste-table.css";
import "./tabs.css";
import "./part-details.css";
import "./collisions-tab.css";
import "./views-tab.css";
import "./breakpoints.css";
