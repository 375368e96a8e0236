// Define: a robot from nothing, from link files, a URDF or another robot, up to a simulated one on the mesh.

import { signal } from "@preact/signals";
import { useEffect, useLayoutEffect } from "preact/hooks";
import { defineText as d } from "../../i18n/texts";
import { startChecking } from "./draft/checks";
import { closeDraft, draft, redo, storedFiles, undo } from "./draft/draft";
import { deleteOtherFiles } from "./draft/file-cache";
import { startReading } from "./draft/mesh-files";
import { listRobots, save } from "./draft/save-and-start";
import type { Tab } from "./draft/selection";
import { TABS, tab } from "./draft/selection";
import { droppedFiles, takeFiles } from "./opening/dropped-files";
import { MissingFiles } from "./opening/missing-files";
import { NewRobot } from "./opening/new-robot";
import { loading, openRobot } from "./opening/open-robot";
import { CollisionsTab } from "./panels/collisions-tab";
import { ConstraintsTab, FramesTab } from "./panels/frames-and-constraints-tabs";
import { KinematicChain } from "./panels/kinematic-chain";
import { PartDetails } from "./panels/part-details";
import { PositionsPanel } from "./panels/positions-panel";
import { ProblemsPanel } from "./panels/problems-panel";
import { RobotTab } from "./panels/robot-tab";
import { Outcomes, Toolbar } from "./panels/toolbar";
import { ViewsTab } from "./panels/views-tab";
import { ScenePanel } from "./scene/scene-panel";
import { DhTable } from "./table/dh-table";
import { PasteTable } from "./table/paste-table";
import "./styles";

const draggedOver = signal(false);

export function DefinePage({ name }: { name: string }) {
  useEffect(() => {
    void deleteOtherFiles(storedFiles());
    const ends = [startChecking(), startReading()];
    void listRobots();
    return () => {
      for (const end of ends) end();
      closeDraft();
    };
  }, []);
  // Open the draft before files can be dropped: they belong to it.
  useLayoutEffect(() => void openRobot(name), [name]);
  useKeys();
  useDrop();
  return (
    <div class={`define grid grow short gap-8 pad-8 ${draft.value ? "editing" : "starting"}`}>
      <div class="define-top grid gap-8">
        <Toolbar />
        <Outcomes />
        <MissingFiles />
      </div>
      {draft.value ? <DraftPanels /> : loading.value ? <p class="dim define-loading">{loading.value}</p> : <NewRobot />}
      {draggedOver.value && <div class="drop-veil grid center">{d("dropped")}</div>}
    </div>
  );
}

function DraftPanels() {
  const tabs: Record<Tab, () => preact.ComponentChild> = {
    details: () => <PartDetails />,
    robot: () => <RobotTab />,
    frames: () => <FramesTab />,
    constraints: () => <ConstraintsTab />,
    collisions: () => <CollisionsTab />,
    views: () => <ViewsTab />,
  };
  return (
    <>
      <div class="define-left stack short gap-8">
        <KinematicChain />
        <ProblemsPanel />
      </div>
      <ScenePanel />
      <PositionsPanel />
      <section class="panel define-right short" aria-label={d("details")}>
        <DhTable />
        <div class="tabs flex wrap" role="tablist" aria-label={d("details")}>
          {TABS.map((each) => (
            <button
              key={each}
              id={`tab-${each}`}
              role="tab"
              aria-selected={tab.value === each}
              aria-controls="tab-panel"
              onClick={() => (tab.value = each)}
            >
              {d(each)}
            </button>
          ))}
        </div>
        <div
          id="tab-panel"
          class="tab-panel grow short scroll"
          role="tabpanel"
          aria-labelledby={`tab-${tab.value}`}
          tabIndex={-1}
        >
          {tabs[tab.value]()}
        </div>
      </section>
      <PasteTable />
    </>
  );
}

/** Handle undo, redo and save keys, wherever the focus is. */
function useKeys(): void {
  useEffect(() => {
    const onKey = (event: KeyboardEvent) => {
      if (!(event.ctrlKey || event.metaKey) || event.altKey || !draft.value) return;
      const key = event.key.toLowerCase();
      const action =
        key === "z" ? (event.shiftKey ? redo : undo) : key === "y" ? redo : key === "s" ? () => void save(false) : null;
      if (!action) return;
      event.preventDefault();
      action();
    };
    addEventListener("keydown", onKey);
    return () => removeEventListener("keydown", onKey);
  }, []);
}

/** Accept dropped files anywhere on the page. */
function useDrop(): void {
  // Register first: a file dropped before would replace the page.
  useLayoutEffect(() => {
    const ending = new AbortController();
    const { signal: until } = ending;
    const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    const over = (event: DragEvent) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      draggedOver.value = true;
    };
    addEventListener("dragover", over, { signal: until });
    addEventListener("dragleave", (event) => event.relatedTarget === null && (draggedOver.value = false), {
      signal: until,
    });
    addEventListener(
      "drop",
      (event) => {
        if (!hasFiles(event) || !event.dataTransfer) return;
        event.preventDefault();
        draggedOver.value = false;
        void takeFiles(droppedFiles(event.dataTransfer));
      },
      { signal: until },
    );
    return () => ending.abort();
  }, []);
}
