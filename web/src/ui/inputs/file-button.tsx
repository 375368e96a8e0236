// A button that opens the browser's file dialog.

import { useRef } from "preact/hooks";

export function FileButton(props: {
  label: string;
  take: (files: readonly File[]) => void;
  /** Endings and media types, as in the `accept` attribute. */
  accept?: string;
  multiple?: boolean;
  disabled?: boolean;
  quiet?: boolean;
  path?: string;
}) {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <button
        class={props.quiet ? "quiet" : "action"}
        data-path={props.path}
        disabled={props.disabled ?? false}
        onClick={() => input.current?.click()}
      >
        {props.label}
      </button>
      <input
        ref={input}
        class="file-input"
        type="file"
        multiple={props.multiple ?? false}
        accept={props.accept}
        tabIndex={-1}
        aria-label={props.label}
        onChange={(event) => {
          const files = [...(event.currentTarget.files ?? [])];
          event.currentTarget.value = ""; // allows the same file again
          if (files.length > 0) props.take(files);
        }}
      />
    </>
  );
}
