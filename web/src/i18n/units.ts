// Units of recorded numbers: degrees and millimetres.

interface Shown {
  unit: string;
  factor: number;
  decimals: number;
}

const SHOWN: Record<string, Shown> = {
  rad: { unit: "°", factor: 180 / Math.PI, decimals: 2 },
  "rad/s": { unit: "°/s", factor: 180 / Math.PI, decimals: 1 },
  "rad/s²": { unit: "°/s²", factor: 180 / Math.PI, decimals: 0 },
  m: { unit: "mm", factor: 1000, decimals: 1 },
  "m/s": { unit: "mm/s", factor: 1000, decimals: 1 },
  A: { unit: "A", factor: 1, decimals: 3 },
  V: { unit: "V", factor: 1, decimals: 2 },
  N: { unit: "N", factor: 1, decimals: 1 },
  N·m: { unit: "N·m", factor: 1, decimals: 2 },
  "°C": { unit: "°C", factor: 1, decimals: 1 },
  "%": { unit: "%", factor: 1, decimals: 1 },
  s: { unit: "s", factor: 1, decimals: 3 },
  "": { unit: "", factor: 1, decimals: 3 },
};

export function shownUnit(unit: string): Shown {
  return SHOWN[unit] ?? { unit, factor: 1, decimals: 3 };
}

/** Return the last part that all of several values share: "position"; empty: none. */
export function commonOf(values: readonly string[]): string {
  const ends = new Set(values.map((value) => value.split("/").at(-1) ?? ""));
  const short = values.some((value) => value.split("/").length < 3);
  return ends.size === 1 && values.length > 1 && !short ? ([...ends][0] ?? "") : "";
}

/** Return a value's short name: "joints/waist/position" is "waist position", or "waist" if `common` is shown. */
export function labelOf(value: string, common: string): string {
  const chunks = value.split("/").slice(1);
  if (common) chunks.pop();
  return chunks.join(" ") || value;
}
