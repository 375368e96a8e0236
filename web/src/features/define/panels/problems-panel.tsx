// The draft's problems in the server's words; a click opens the field.

import { defineText as d } from "../../../i18n/texts";
import { Panel } from "../../../ui/panel/panel";
import { checkError, checked, checking, problems, readingShapes } from "../draft/checks";
import { openField } from "../draft/selection";

export function ProblemsPanel() {
  const found = problems.value;
  const busy = checking.value || readingShapes.value;
  const count = found.length === 1 ? d("problem_one") : d("problems", { count: found.length });
  return (
    <Panel
      name="checks"
      title={d("checks")}
      end={
        <span class="dim small" role="status">
          {busy ? d("checking") : found.length > 0 ? count : ""}
        </span>
      }
    >
      <div class="check-list scroll tall-40">
        {checkError.value && <p class="problem-word">{d("check_failed", { text: checkError.value })}</p>}
        {checked.value && !readingShapes.value && found.length === 0 && <p class="dim small">{d("no_problems")}</p>}
        {found.map(({ path, text }) => (
          <button
            key={`${path.join("/")} ${text}`}
            class="problem pick flex baseline break small"
            onClick={() => openField(path)}
          >
            <span class="shape warning" aria-hidden="true" />
            <span>{text}</span>
          </button>
        ))}
      </div>
    </Panel>
  );
}
