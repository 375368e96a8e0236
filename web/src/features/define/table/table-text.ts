// A D-H table as text from a spreadsheet, a paper or a data sheet: its columns, units and values.

import { parse } from "papaparse";
import type { JointType, Units } from "../description/description";
import { metres, radians, tidy } from "../description/description";
import type { ColumnKey } from "./dh-columns";
import { COLUMNS } from "./dh-columns";
import type { DecimalSign, Dimension, Unit } from "./table-units";
import { decimal, decimalSign, plain, splitHeader, unitNamed } from "./table-units";

/** A D-H table has a few hundred characters; more costs the page time. */
export const MOST_CHARACTERS = 100_000;
/** Rows with a joint each. */
export const MOST_ROWS = 64;
const MOST_COLUMNS = 40;
const LONGEST_CELL = 100; // characters that are looked at
const HEADER_WITHIN = 6; // rows, below titles

export const DELIMITERS = ["\t", ";", "|", ",", " "] as const;
export type Delimiter = (typeof DELIMITERS)[number];
export type Meaning = ColumnKey | "limits" | "name" | "type" | "ignored";
export const MEANINGS: readonly Meaning[] = [
  "ignored",
  "name",
  "type",
  ...COLUMNS.map(({ key }) => key).slice(0, 6),
  "limits",
  "max_speed",
  "max_acceleration",
];

export interface TextColumn {
  head: string;
  meaning: Meaning;
  unit: Unit | null;
}

export interface TextRow {
  /** Number of the row in the text, from 1. */
  number: number;
  cells: readonly string[];
}

/** What the text itself says. */
export interface TextTable {
  delimiter: Delimiter;
  columns: readonly TextColumn[];
  rows: readonly TextRow[];
  /** Rows above the header, which contain no values. */
  titles: readonly TextRow[];
  decimal: { sign: DecimalSign; sure: boolean };
  hasHeader: boolean;
  /** Whether the header gives a and α the index i−1, as in the modified convention. */
  modified: boolean;
}

export type Refusal = { refused: "empty" | "too_long" | "too_many_rows" | "one_column"; count: number };

const NAMES: Record<Exclude<Meaning, "ignored">, RegExp> = {
  a: /^(a|r|linklength|length|linka|连杆长度|杆长|长度)$/,
  alpha: /^(alpha|alfa|α|twist|linktwist|twistangle|连杆扭角|扭角|扭转角|连杆转角)$/,
  d: /^(d|linkoffset|jointoffset|offsetd|连杆偏距|偏距|偏置|偏移)$/,
  theta: /^(theta|θ|q|jointangle|angle|thetaoffset|θoffset|offsettheta|offsetθ|angleoffset|关节角|转角|角度)$/,
  lower:
    /^(min|minimum|low|lower|lowerlimit|lowlimit|minlimit|limitmin|limitlower|lowerbound|qmin|qlow|θmin|thetamin|(min|minimum)(angle|position|joint|range)|(angle|position|joint|range)min|下限|最小|最小值|最小角度|下限位)$/,
  upper:
    /^(max|maximum|high|upper|upperlimit|highlimit|maxlimit|limitmax|limitupper|upperbound|qmax|qup|θmax|thetamax|(max|maximum)(angle|position|joint|range)|(angle|position|joint|range)max|上限|最大|最大值|最大角度|上限位)$/,
  limits:
    /^(limit|limits|range|ranges|jointlimits?|jointrange|motionrange|rangeofmotion|workingrange|axisrange|axislimits?|限位|范围|运动范围|关节限位|工作范围)$/,
  max_speed:
    /^(speed|speeds|velocity|velocities|vel|v|vmax|velmax|maxvel|speedmax|velocitymax|(max|maximum|rated|axis|joint)(speed|velocity)|(speed|velocity)limits?|qdmax|qd|geschwindigkeit|速度|最大速度|角速度|额定速度)$/,
  max_acceleration:
    /^(acceleration|accel|acc|accmax|maxacc|maxaccel|amax|accelerationmax|(max|maximum|axis|joint)acceleration|accelerationlimits?|qddmax|beschleunigung|加速度|最大加速度|角加速度)$/,
  name: /^(joint|joints|name|names|axis|axes|link|links|jointname|linkname|axisname|jointaxis|achse|gelenk|关节|关节名称|名称|轴|连杆|连杆名称)$/,
  type: /^(type|jointtype|kind|sigma|σ|rp|类型|关节类型)$/,
};
const INDEX = /^(i|j|k|n|no|nr|number|index|id|#|序号|编号)?$/;

/** Return the columns, rows and units of a text, or why it is no table. `given`: the separator, if it is chosen. */
export function readText(text: string, given: Delimiter | null = null): TextTable | Refusal {
  if (text.length > MOST_CHARACTERS) return { refused: "too_long", count: text.length };
  const delimiter = given ?? delimiterOf(text);
  const all = cellsOf(text, delimiter);
  if (all.length === 0) return { refused: "empty", count: 0 };
  if (all.length > MOST_ROWS + HEADER_WITHIN) return { refused: "too_many_rows", count: all.length };
  const width = Math.min(MOST_COLUMNS, Math.max(...all.map(({ cells }) => cells.length)));
  if (width < 2) return { refused: "one_column", count: all.length };
  const header = all.slice(0, HEADER_WITHIN).findIndex(isHeader);
  const titles = header > 0 ? all.slice(0, header) : [];
  const rest = all.slice(header + 1);
  // A row of units below the names.
  const units = header >= 0 && rest[0]?.cells.every((cell) => !cell || bracketless(cell)) ? rest.shift() : undefined;
  const heads = all[header]?.cells ?? [];
  const columns = Array.from({ length: width }, (_, index): TextColumn => {
    const head = heads[index] ?? "";
    const { name, unit } = splitHeader(head);
    const own = unit ?? bracketless(units?.cells[index] ?? "");
    return { head: head.replace(/\s+/g, " "), meaning: header >= 0 ? meaningOf(name, own) : "ignored", unit: own };
  });
  const data = rest.filter(({ cells }) => cells.some((cell) => /\d|π|pi|θ|q/i.test(cell)));
  if (header < 0) nameColumns(columns, data);
  return {
    delimiter,
    columns: withoutSeconds(columns),
    rows: data,
    titles: [...titles, ...rest.filter((row) => !data.includes(row))],
    decimal: decimalSign(data.flatMap(({ cells }) => cells)),
    hasHeader: header >= 0,
    modified: columns.some(
      ({ head, meaning }) => /^(a|alpha)$/.test(meaning) && /i\s*[-−–]\s*1/.test(head.normalize("NFKC")),
    ),
  };
}

function bracketless(text: string): Unit | null {
  return unitNamed(text.trim().replace(/^[([{](.*)[)\]}]$/, "$1"));
}

/** Return the separator: a tab from a spreadsheet, else what every row has. */
function delimiterOf(text: string): Delimiter {
  const lines = text
    .split(/\r\n?|\n/)
    .filter((line) => line.trim())
    .slice(0, 20);
  const share = (sign: string) => lines.filter((line) => line.includes(sign)).length / Math.max(1, lines.length);
  if (text.includes("\t")) return "\t";
  const found = ([";", "|"] as const).find((sign) => share(sign) > 0.5);
  if (found) return found;
  // "0,5 90 0,2" has decimal commas between spaces.
  const spaced = lines.filter((line) => /\S\s+\S/.test(line.trim()) && !/,\s/.test(line) && !/"/.test(line)).length;
  return share(",") > 0.5 && spaced < lines.length / 2 ? "," : " ";
}

function cellsOf(text: string, delimiter: Delimiter): TextRow[] {
  const lines: string[][] =
    delimiter === " " || delimiter === "|"
      ? text.split(/\r\n?|\n/).map((line) => {
          if (delimiter === "|")
            return line
              .trim()
              .replace(/^\||\|$/g, "")
              .split("|");
          return line.trim().split(/\s{2,}/.test(line.trim()) ? /\s{2,}/ : /\s+/);
        })
      : parse<string[]>(text, { delimiter, preview: MOST_ROWS + HEADER_WITHIN + 1, skipEmptyLines: false }).data;
  const rows = lines
    .map((cells, index) => ({ number: index + 1, cells: cells.map((cell) => cell.slice(0, LONGEST_CELL).trim()) }))
    .filter(({ cells }) => cells.some((cell) => cell && !/^:?-{3,}:?$/.test(cell)));
  // Columns that are empty throughout: a selection wider than its table.
  const used = Math.max(0, ...rows.map(({ cells }) => cells.findLastIndex((cell) => cell) + 1));
  return rows.map(({ number, cells }) => ({ number, cells: cells.slice(0, used) }));
}

function isHeader({ cells }: TextRow): boolean {
  const known = cells.filter((cell) => cell && meaningOf(splitHeader(cell).name, splitHeader(cell).unit) !== "ignored");
  const values = cells.filter((cell) => /^[-+−]?[\d.,]*\d[\d.,]*\s*°?$/.test(cell));
  return known.length >= 2 && values.length === 0;
}

/** Return what a header's name means. */
function meaningOf(name: string, unit: Unit | null): Meaning {
  const sign = /limit|range/.test(name) ? (/[+]/.test(name) ? "upper" : /-(?!\s*1)/.test(name) ? "lower" : null) : null;
  if (sign && !/\+\s*\/\s*-/.test(name)) return sign;
  const bare = name.replace(/i\s*[-+]\s*1/, "").replace(/[^\p{L}\p{N}]/gu, "");
  if (/^offset$/.test(bare)) return unit?.dimension === "angle" ? "theta" : "d";
  const found = (word: string) =>
    (Object.keys(NAMES) as (keyof typeof NAMES)[]).find((meaning) => NAMES[meaning].test(word));
  if (INDEX.test(bare)) return "ignored";
  // "ai", "αi", "θ1": with an index.
  return found(bare) ?? found(bare.replace(/^(a|r|d|alpha|α|theta|θ|q)(i|j|k|n|\d)$/, "$1")) ?? "ignored";
}

/** Name the columns of a text without a header: in the order of the page's table. */
function nameColumns(columns: TextColumn[], rows: readonly TextRow[]): void {
  const first = rows.map(({ cells }) => cells[0] ?? "");
  const words = first.every((cell) => decimal(cell, ".") === null && decimal(cell, ",") === null);
  const counted = columns.length > 4 && first.every((cell, index) => cell === String(index + (Number(first[0]) || 0)));
  const start = words ? 1 : counted && rows.length > 1 ? 1 : 0;
  columns.forEach((column, index) => {
    column.meaning = index < start ? (words ? "name" : "ignored") : (COLUMNS[index - start]?.key ?? "ignored");
  });
}

/** Ignore the second column of one meaning. */
function withoutSeconds(columns: readonly TextColumn[]): TextColumn[] {
  const met = new Set<Meaning>();
  return columns.map((column) => {
    const again = met.has(column.meaning);
    met.add(column.meaning);
    return again ? { ...column, meaning: "ignored" as const } : column;
  });
}

/** The user's choices where the text says nothing. */
export interface Reading {
  decimal: DecimalSign;
  /** Units of columns without one. */
  length: Units["length"];
  angle: Units["angle"];
}

export interface ReadRow {
  /** Number of the row in the text, from 1. */
  number: number;
  name: string | null;
  type: JointType | null;
  /** In the description's units. */
  values: Partial<Record<ColumnKey, number>>;
}

export interface CellProblem {
  row: number;
  /** Index of the column. */
  column: number;
  text: string;
}

export interface ReadTable {
  rows: ReadRow[];
  problems: CellProblem[];
}

/** Return the values of a table; cells that cannot be read are problems and set nothing.
 *
 * @param types Type of each row's joint, where the table names none. */
export function readValues(
  table: Pick<TextTable, "columns" | "rows">,
  reading: Reading,
  units: Units,
  types: readonly (JointType | undefined)[],
): ReadTable {
  const problems: CellProblem[] = [];
  const rows = table.rows.map(({ number, cells }, index): ReadRow => {
    const row: ReadRow = { number, name: null, type: null, values: {} };
    const type = () => row.type ?? types[index] ?? "rotary";
    const each = (wanted: (meaning: Meaning) => boolean, read: (cell: string, column: TextColumn) => boolean) =>
      table.columns.forEach((column, at) => {
        const cell = plain(cells[at] ?? "");
        if (!wanted(column.meaning) || cell === "" || /^(-+|n\/?a|\.)$/.test(cell)) return;
        if (!read(cell, column)) problems.push({ row: number, column: at, text: (cells[at] ?? "").slice(0, 40) });
      });
    each(
      (meaning) => meaning === "type",
      (cell) => (row.type = typeNamed(cell)) !== null,
    );
    // A variable in the column of d says that the joint is prismatic.
    each(
      (meaning) => row.type === null && (meaning === "d" || meaning === "theta"),
      (cell, { meaning }) => {
        if (variableIn(cell, meaning === "d" ? "d" : "theta") !== null)
          row.type = meaning === "d" ? "prismatic" : "rotary";
        return true;
      },
    );
    each(
      (meaning) => meaning === "name",
      (cell) => {
        const name = nameOf(cells[table.columns.findIndex(({ meaning }) => meaning === "name")] ?? "");
        if (name !== null) row.name = name;
        return name !== null || /^\d+$/.test(cell);
      },
    );
    each(
      (meaning) => meaning === "limits",
      (cell, column) => {
        const range = rangeOf(cell, (text) => cellValue(text, "lower", column.unit, type(), reading, units));
        if (range) [row.values.lower, row.values.upper] = range;
        return range !== null;
      },
    );
    each(
      (meaning) => COLUMNS.some(({ key }) => key === meaning),
      (cell, column) => {
        const key = column.meaning as ColumnKey;
        const own = key === "theta" || key === "d" ? variableIn(cell, key) : null;
        const value = own === "" ? 0 : cellValue(own ?? cell, key, column.unit, type(), reading, units);
        if (value !== null) row.values[key] = value;
        return value !== null;
      },
    );
    return row;
  });
  return { rows, problems };
}

function typeNamed(cell: string): JointType | null {
  if (/^(r|rot|rotary|revolute|rotational|rotation|0|旋转|转动|continuous)$/.test(cell)) return "rotary";
  if (/^(p|prismatic|linear|translational|translation|t|1|移动|平移)$/.test(cell)) return "prismatic";
  return null;
}

/** Return a valid name of a joint; null: it contains none. */
export function nameOf(text: string): string | null {
  const name = text
    .normalize("NFKC")
    .trim()
    .replace(/[^A-Za-z0-9_.-]+/g, "_")
    .replace(/^[^A-Za-z0-9]+|_+$/g, "");
  return name && !/^\d+$/.test(name) ? name.slice(0, 64) : null;
}

/** Return the constant beside a joint's variable, "90°" in "θ1 + 90°"; "": no constant; null: no variable. */
function variableIn(cell: string, key: "d" | "theta"): string | null {
  const symbol = key === "d" ? "(?:d|q|l|s)" : "(?:θ|theta|q|t|th)";
  const variable = `${symbol}_?\\{?(?:\\d{1,2}|i|v)?\\}?\\*?(?:\\(t\\))?`;
  if (new RegExp(`^${variable}$`).test(cell) || cell === "variable" || cell === "var") return "";
  const after = new RegExp(`^${variable} ?([-+].+)$`).exec(cell);
  if (after?.[1]) return after[1].replace(/^([-+]) /, "$1");
  const before = new RegExp(`^(.+?) ?\\+ ?${variable}$`).exec(cell);
  return before?.[1] ?? null;
}

/** Return both limits: "±170", "-130°/154°", "-90 .. 90", "-90 to 90", "[-90, 90]". */
function rangeOf(cell: string, value: (text: string) => number | null): [number, number] | null {
  const both = /^(?:±|\+ ?\/ ?-|\+-) ?(.+)$/.exec(cell);
  if (both?.[1]) {
    const limit = value(both[1]);
    return limit === null ? null : [-limit, limit];
  }
  const inner = cell.replace(/^[([{<](.*)[)\]}>]$/, "$1").trim();
  for (const sign of [
    / ?\.{2,3} ?/,
    / to /,
    / bis /,
    /~/,
    /;/,
    / ?\/ ?/,
    /, /,
    / 至 ?/,
    /至/,
    / - /,
    /(?<=[\d°]) (?=[-+])/,
    /(?<=[\d°])-(?=[-+\d])/,
  ]) {
    const parts = inner.split(sign);
    if (parts.length !== 2) continue;
    const [one, other] = parts.map((part) => value(part.trim()));
    if (typeof one === "number" && typeof other === "number") return one <= other ? [one, other] : [other, one];
  }
  return null;
}

const DIMENSIONS: Partial<Record<ColumnKey, Dimension>> = { a: "length", d: "length", alpha: "angle", theta: "angle" };

/** Return a cell's value in the description's units; null: it cannot be read. */
function cellValue(
  cell: string,
  key: ColumnKey,
  unit: Unit | null,
  type: JointType,
  reading: Reading,
  units: Units,
): number | null {
  const dimension = DIMENSIONS[key] ?? (type === "rotary" ? "angle" : "length");
  const one = dimension === "angle" ? radians(units) : metres(units);
  const [, number, after = ""] = /^([-+]? ?[\d.,'’ ]*\d[\d.,]*(?:e[-+]?\d+)?) ?(.*)$/.exec(cell) ?? [];
  if (number !== undefined) {
    const own = after ? unitNamed(after) : null;
    if (after && own?.dimension !== dimension) return piOf(cell, dimension, one, reading.decimal);
    const value = decimal(number, reading.decimal);
    if (value === null) return null;
    const chosen = dimension === "angle" ? radians(reading) : metres(reading);
    const factor = own?.factor ?? (unit?.dimension === dimension ? unit.factor : chosen);
    return tidy((value * factor) / one);
  }
  return piOf(cell, dimension, one, reading.decimal);
}

/** Return a multiple of π, "-π/2" or "3pi/4"; null: it is none. */
function piOf(cell: string, dimension: Dimension, one: number, sign: DecimalSign): number | null {
  const [match, minus, before, , below] =
    /^([-+]?) ?([\d.,]*) ?\*? ?(pi|π) ?(?:[/⁄] ?([\d.,]+))?(?: ?rad)?$/.exec(cell) ?? [];
  if (match === undefined || dimension === "length") return null;
  const times = before ? decimal(before, sign) : 1;
  const by = below ? decimal(below, sign) : 1;
  if (times === null || !by) return null;
  return tidy(((minus === "-" ? -1 : 1) * times * Math.PI) / by / one);
}
