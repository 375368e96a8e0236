// A note from the robot's page, on the present or on the last seconds; over the 3-D view, so that no control moves.

import { signal } from "@preact/signals";
import { useState } from "preact/hooks";
import { notesText as n } from "../../i18n/texts";
import type { NoteTime } from "../../mesh/services/notes";
import { NoteForm } from "../../panels/note-form";
import { Choice } from "../../ui/inputs/choice";
import "./record-panel.css";

const BEFORE_S = { now: 0, last_10: 10, last_60: 60 } as const;
type Before = keyof typeof BEFORE_S;

/** Whether the panel is open, for all robots. */
const shown = signal(false);

export function NoteButton() {
  return (
    <button
      class="note-button"
      aria-expanded={shown.value}
      title={n("note_hint")}
      onClick={() => (shown.value = !shown.value)}
    >
      {n("open")}
    </button>
  );
}

export function NotePanel({ robotKey }: { robotKey: string }) {
  const [before, setBefore] = useState<Before>("now");
  if (!shown.value) return null;
  return (
    <section class="panel note-panel" aria-label={n("note")}>
      <NoteForm robotKey={robotKey} on={() => timeBefore(before)} close={() => (shown.value = false)}>
        <Choice
          label={n("on")}
          values={Object.keys(BEFORE_S) as Before[]}
          chosen={before}
          text={n}
          choose={setBefore}
        />
      </NoteForm>
    </section>
  );
}

/** Return the range of the last seconds; null: now. */
function timeBefore(chosen: Before): NoteTime | null {
  const end = Date.now();
  return chosen === "now" ? null : { begin: end - BEFORE_S[chosen] * 1000, end };
}
