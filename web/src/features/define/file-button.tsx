// A button that opens the browser's file dialog.

import { useRef } from "preact/hooks";
import type { Dropped } from "./dropped-files";

export function FileButton(props: { label: string; take: (files: Dropped[]) => void; quiet?: boolean; path?: string }) {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <button class={props.quiet ? "quiet" : "action"} data-path={props.path} onClick={() => input.current?.click()}>
        {props.label}
      </button>
      <input
        ref={input}
        class="file-input"
        type="file"
        multiple
        tabIndex={-1}
        aria-label={props.label}
        onChange={(event) => {
          const files = [...(event.currentTarget.files ?? [])];
          event.currentTarget.value = ""; // allows the same file again
          if (files.length > 0) props.take(files.map((file) => ({ path: file.name, file })));
        }}
      />
    </>
  );
}
