// The theme: dark unless the person or the system chooses light.

import { signal } from "@preact/signals";
import { readStored } from "../../i18n/stored";

export type Theme = "dark" | "light";
const STORAGE_KEY = "robomesh.theme";

function initial(): Theme {
  const stored = readStored(STORAGE_KEY);
  if (stored === "dark" || stored === "light") return stored;
  return matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
}

export const theme = signal<Theme>(initial());

export function applyTheme(): void {
  document.documentElement.dataset.theme = theme.value;
}

export function switchTheme(): void {
  theme.value = theme.value === "dark" ? "light" : "dark";
  localStorage.setItem(STORAGE_KEY, theme.value);
  applyTheme();
}
