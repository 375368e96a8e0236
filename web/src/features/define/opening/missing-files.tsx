// Missing files that other files refer to, until they are added or skipped.

import { defineText as d } from "../../../i18n/texts";
import { Button } from "../../../ui/inputs/button";
import { FileButton } from "../../../ui/inputs/file-button";
import { missingFiles } from "../draft/mesh-files";
import { chosen, continueWithoutMissing, skippedFiles, takeFiles, waitingUrdf } from "./dropped-files";

export function MissingFiles() {
  const waiting = waitingUrdf.value;
  const missing = waiting
    ? waiting.missing.map((name) => ({ of: waiting.file, name, path: name }))
    : missingFiles().filter(({ path }) => !skippedFiles.value.has(path));
  if (missing.length === 0) return null;
  const continueWithout = () => {
    if (waiting) void continueWithoutMissing();
    else skippedFiles.value = new Set([...skippedFiles.value, ...missing.map(({ path }) => path)]);
  };
  return (
    <section class="panel missing-files wrap spread gap-8-24 pad-8-16" aria-label={d("missing_title")} role="alert">
      <div>
        <h2>{d("missing_title")}</h2>
        {waiting && <p>{d("missing_count", { found: waiting.found, missing: waiting.missing.length })}</p>}
        <ul>
          {missing.map(({ of, name }) => (
            <li key={`${of} ${name}`}>
              <span class="dim">{d("missing_for", { file: of })}</span> <strong>{name}</strong>
            </li>
          ))}
        </ul>
        <p class="dim small">{d("missing_words")}</p>
      </div>
      <div class="flex gap-8">
        <FileButton label={d("choose_files")} multiple take={(files) => void takeFiles(chosen(files))} />
        <Button quiet text={d("go_on_without")} onClick={continueWithout} />
      </div>
    </section>
  );
}
