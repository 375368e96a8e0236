// The server's problems with the draft while the user types, and the tool's position.

import { computed, effect, signal } from "@preact/signals";
import { defineText as d } from "../../../i18n/texts";
import { reasonOf } from "../../../mesh/console/connection";
import { RefusedRequest } from "../../../mesh/console/refusal";
import { bodies } from "../description/description";
import { fileName } from "../description/paths";
import type { Draft } from "./draft";
import { draft, identity, parsePath } from "./draft";
import { shapeOf } from "./mesh-files";
import { positions } from "./selection";
import type { Checked, Problem } from "./server-requests";
import { check } from "./server-requests";

const CHECK_DELAY_MS = 200;
const RETRY_MS = 1500;
// A link's shape beyond these sizes probably has the wrong unit [m].
const LARGEST_M = 10;
const SMALLEST_M = 0.001;

export const checked = signal<Checked | null>(null);
/** Whether the current draft's answer is pending. */
export const checking = signal(false);
/** Why it could not be checked; "" when it could. */
export const checkError = signal("");

/** Invalid texts of number fields, by path; the draft keeps the last valid number. */
export const invalidNumbers = signal<ReadonlyMap<string, string>>(new Map());

/** Record an invalid number; null: it is valid. */
export function setInvalidNumber(path: string, text: string | null): void {
  if (text === (invalidNumbers.peek().get(path) ?? null)) return;
  const others = [...invalidNumbers.peek()].filter(([other]) => other !== path);
  invalidNumbers.value = new Map(text === null ? others : [...others, [path, text]]);
}

// In another draft, or after links change, a path names another field.
const fields = computed(
  () => `${identity.value.id} ${draft.value?.description.joint.map(({ name }) => name).join(" ") ?? ""}`,
);
effect(() => {
  if (fields.value) invalidNumbers.value = new Map();
});

/** Problems: from the server's check, unreadable shapes, and invalid numbers. */
export const problems = computed<readonly Problem[]>(() => {
  const typed = [...invalidNumbers.value].map(([path, text]) => ({
    path: parsePath(path),
    text: d("wrong_number", { text: text.trim() || " " }),
  }));
  const problems = [...typed, ...(checked.value?.problems ?? [])];
  const places = new Set(problems.map(({ path }) => path.join("/")));
  return [...problems, ...shapeProblems().filter(({ path }) => !places.has(path.join("/")))];
});

function shapeProblems(): Problem[] {
  const now = draft.value;
  if (!now) return [];
  return bodies(now.description).flatMap(({ mesh, mesh_scale: scale }, index) => {
    const shape = mesh ? shapeOf(mesh, now.files) : undefined;
    if (typeof shape !== "object") return [];
    const place = index === 0 ? ["base"] : ["joint", index - 1, "link"];
    if ("error" in shape) return { path: [...place, "mesh"], text: shape.error };
    const { min, max, triangles } = shape.info;
    const size = Math.max(...max.map((value, axis) => value - (min[axis] ?? 0))) * scale;
    if (triangles === 0 || (size >= SMALLEST_M && size <= LARGEST_M)) return [];
    const sizeText = size >= 1 ? `${Number(size.toPrecision(3))} m` : `${Number((size * 1000).toPrecision(2))} mm`;
    return {
      path: [...place, "mesh_scale"],
      text: d("odd_size", { file: fileName(mesh), size: sizeText }),
    };
  });
}

/** Whether shapes are still being read, which may add problems. */
export const readingShapes = computed(() => {
  const now = draft.value;
  return now !== null && bodies(now.description).some(({ mesh }) => mesh && shapeOf(mesh, now.files) === "reading");
});

let timer: ReturnType<typeof setTimeout> | undefined;
let request: AbortController | null = null;

/** Check each change of the draft and of the joints until the returned function is called. */
export function startChecking(): () => void {
  const end = effect(() => {
    const now = draft.value;
    const joints = positions.value;
    clearTimeout(timer);
    if (!now) {
      request?.abort(); // its answer is of a closed draft
      checked.value = null;
      return;
    }
    checking.value = true;
    timer = setTimeout(() => void ask(now, joints), CHECK_DELAY_MS);
  });
  return () => {
    end();
    clearTimeout(timer);
    request?.abort();
    checked.value = null;
  };
}

async function ask(of: Draft, joints: readonly number[]): Promise<void> {
  request?.abort();
  const own = (request = new AbortController());
  try {
    const answer = await check(of, joints, own.signal);
    if (own.signal.aborted) return;
    checked.value = answer;
    checkError.value = "";
  } catch (error) {
    if (own.signal.aborted) return;
    checked.value = null;
    checkError.value = reasonOf(error);
    // Retry: the console may come back without any typing.
    if (error instanceof RefusedRequest && (error.status === 0 || error.status >= 500)) {
      clearTimeout(timer);
      timer = setTimeout(() => void ask(of, joints), RETRY_MS);
    }
  }
  checking.value = false;
}

/** Return a field's problems: at its path, below it, or of the list that contains it. */
export function problemsAt(path: string): readonly Problem[] {
  return problems.value.filter((problem) => {
    const at = problem.path.join("/");
    return (
      at === path ||
      at.startsWith(`${path}/`) ||
      (at !== "" && /^\/\d$/.test(path.slice(at.length)) && path.startsWith(at))
    );
  });
}
