// Units in headers and cells of a pasted table, and numbers as spreadsheets write them.

export type Dimension = "length" | "angle";

export interface Unit {
  dimension: Dimension;
  /** Metres or radians in it, per second for speeds. */
  factor: number;
  /** Its power of seconds in the denominator: 0, 1 for speeds, 2 for accelerations. */
  per: 0 | 1 | 2;
  text: string;
}

const DEGREE = Math.PI / 180;
// Texts after NFKC and in lower case, so "s²" is "s2".
const BASES: readonly [Dimension, number, readonly string[]][] = [
  ["length", 0.001, ["mm", "millimeter", "millimeters", "millimetre", "millimetres", "毫米"]],
  ["length", 0.01, ["cm", "厘米"]],
  ["length", 1, ["m", "meter", "meters", "metre", "metres", "米"]],
  ["length", 0.0254, ["in", "inch", "inches", '"', "英寸"]],
  ["angle", DEGREE, ["°", "deg", "degs", "degree", "degrees", "grad°", "度"]],
  ["angle", 1, ["rad", "rads", "radian", "radians", "弧度"]],
];
const PER_TEXTS: readonly (readonly string[])[] = [
  [""],
  ["/s", "/sec", "/秒", "s-1", "ps"],
  ["/s2", "/s^2", "/sec2", "/sec^2", "/秒2", "s-2"],
];
const UNITS = new Map<string, Unit>();
for (const [dimension, factor, names] of BASES) {
  PER_TEXTS.forEach((texts, per) => {
    for (const name of names) {
      for (const text of texts)
        UNITS.set(name + text, { dimension, factor, per: per as Unit["per"], text: name + text });
    }
  });
}
for (const text of ["rpm", "r/min", "rev/min", "u/min", "min-1", "1/min", "转/分"]) {
  UNITS.set(text, { dimension: "angle", factor: (2 * Math.PI) / 60, per: 1, text });
}

/** Return text in one form: compatibility characters and minus signs replaced, in lower case. */
export function plain(text: string): string {
  return text
    .normalize("NFKC")
    .toLowerCase()
    .replace(/[−–—‒﹣]/g, "-")
    .replace(/º/g, "°")
    .replace(/[\s\u200b\ufeff]+/g, " ")
    .trim();
}

/** Return the unit that a text names; null: none. */
export function unitNamed(text: string): Unit | null {
  return UNITS.get(plain(text).replace(/[\s.·*]/g, "")) ?? null;
}

/** Split a header into its name and its unit: "a (mm)", "alpha [deg]", "d / m", "θ in rad", "speed °/s". */
export function splitHeader(text: string): { name: string; unit: Unit | null } {
  const head = plain(text);
  for (const [whole, inside] of head.matchAll(/[([{]([^()[\]{}]*)[)\]}]/g)) {
    const unit = unitNamed(inside ?? "");
    if (unit) return { name: head.replace(whole, " ").trim(), unit };
  }
  const slash = /^([^/]+)\/(.+)$/.exec(head);
  const over = unitNamed(slash?.[2] ?? "-");
  if (slash && over && !unitNamed(head)) return { name: slash[1]?.trim() ?? "", unit: over };
  const last = /^(.+?)[ ,:](?:in )?(\S+)$/.exec(head);
  const after = unitNamed(last?.[2] ?? "-");
  // "link in" means a length in inches nowhere: a bare "in" or "m" is a unit only after "in".
  if (last && after && (!/^(in|m)$/.test(last[2] ?? "") || / in m$/.test(head))) {
    return { name: last[1]?.replace(/ in$/, "").trim() ?? "", unit: after };
  }
  return { name: head, unit: null };
}

export type DecimalSign = "." | ",";

/** Parse a number with a decimal sign; the other sign, spaces and apostrophes may group thousands. Null: none. */
export function decimal(text: string, sign: DecimalSign): number | null {
  const other = sign === "." ? "," : ".";
  const [, minus, digits, exponent = ""] = /^([-+]?)\s*([\d.,'’ ]*\d[\d.,]*)(e[-+]?\d+)?$/.exec(plain(text)) ?? [];
  if (digits === undefined) return null;
  const [whole = "", fraction, ...more] = digits.split(sign);
  if (more.length > 0 || (fraction !== undefined && !/^\d*$/.test(fraction))) return null;
  const groups = whole.split(new RegExp(`[${other}'’ ]`));
  const grouped = groups.length > 1;
  if (grouped && !groups.every((group, index) => (index === 0 ? /^\d{1,3}$/ : /^\d{3}$/).test(group))) return null;
  if (!grouped && !/^\d*$/.test(whole)) return null;
  const value = Number(`${minus}${groups.join("")}.${fraction || "0"}${exponent}`);
  return Number.isFinite(value) ? value : null;
}

/** Return the decimal sign of numbers, and whether another reading is possible. */
export function decimalSign(texts: readonly string[]): { sign: DecimalSign; sure: boolean } {
  // One comma in a number without a point; "1,234" may also be thousands.
  const commas = texts.map(plain).filter((text) => /^[^.,]*\d*,\d+[^.,]*$/.test(text));
  const points = texts.map(plain).filter((text) => /^[^.,]*\d*\.\d+[^.,]*$/.test(text));
  const both = texts.map(plain).find((text) => /\d/.test(text) && text.includes(",") && text.includes("."));
  if (both) return { sign: both.lastIndexOf(",") > both.lastIndexOf(".") ? "," : ".", sure: true };
  if (commas.length === 0) return { sign: ".", sure: true };
  const thousands = (text: string) => /(^|[^\d])[1-9]\d{0,2},\d{3}([^\d]|$)/.test(text);
  if (points.length > 0) return { sign: ".", sure: commas.every(thousands) };
  return { sign: ",", sure: !commas.every(thousands) };
}
