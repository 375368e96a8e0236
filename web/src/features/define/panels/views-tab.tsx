// Named views for the video and the 3-D panel, set from this page's camera.

import { useState } from "preact/hooks";
import { defineText as d, viewText } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import type { View } from "../description/description";
import { draft, editDraft, setValue } from "../draft/draft";
import { ProblemWords, SelectField, TextField } from "../draft/fields";
import { currentCamera, requestedView } from "../scene/scene-panel";
import { USUAL_VIEWS, viewOf } from "../scene/views";

function setFromCamera(name: string): void {
  const look = currentCamera.value?.();
  if (look) editDraft(({ description }) => void (description.view[name] = viewOf(look, description)));
}

export function ViewsTab() {
  const [fresh, setFresh] = useState("");
  const now = draft.value;
  if (!now) return null;
  const given = now.description.view;
  const names = [...new Set<string>([...USUAL_VIEWS, ...Object.keys(given)])];
  const usable = /^[A-Za-z0-9][A-Za-z0-9_.-]*$/.test(fresh) && !names.includes(fresh);
  return (
    <>
      <p class="dim small tab-intro">{d("views_words")}</p>
      <ul class="view-list pad-0-16">
        {names.map((name) => (
          <li key={name}>
            <span class="view-name">
              <strong>{viewText(name)}</strong>
              <span class="dim small">{d(given[name] ? "view_own" : "view_auto")}</span>
            </span>
            <Button
              quiet
              text={d("view_look")}
              aria-label={d("view_look_at", { view: viewText(name) })}
              onClick={() => (requestedView.value = { name })}
            />
            <Button
              quiet
              text={d("view_set")}
              aria-label={d("view_set_of", { view: viewText(name) })}
              disabled={!currentCamera.value}
              onClick={() => setFromCamera(name)}
            />
            {given[name] && (
              <span class="view-more flex to-end gap-8">
                <SelectField
                  quiet
                  path={`view/${name}/projection`}
                  label={`${d("projection")}: ${viewText(name)}`}
                  values={["orthographic", "perspective"] as const}
                  text={(projection: View["projection"]) => d(projection)}
                  set={(projection) => {
                    setValue(`view/${name}/projection`, projection, true);
                    requestedView.value = { name };
                  }}
                />
                <Button
                  quiet
                  text={d((USUAL_VIEWS as readonly string[]).includes(name) ? "view_reset" : "remove")}
                  onClick={() => editDraft(({ description }) => void delete description.view[name])}
                />
              </span>
            )}
          </li>
        ))}
      </ul>
      <div class="view-add">
        <TextField path="view" label={d("view_new")} value={fresh} set={setFresh} />
        <button
          class="action small-action"
          disabled={!usable || !currentCamera.value}
          onClick={() => {
            setFromCamera(fresh);
            setFresh("");
          }}
        >
          {d("view_add")}
        </button>
      </div>
      <ProblemWords path="view" />
    </>
  );
}
