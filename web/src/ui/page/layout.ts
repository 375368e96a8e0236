// Layout of a robot's page as text: the part of the address after "?", readable, and checked when it is read.
//
//   plot=60,joints/waist/position,kinematics/tool/x & plot=600,joints & video=front,large & camera=free,1.2,…

/** A plot: its fields, null for the positions of all joints, and its time range [s]. */
export interface Plot {
  fields: readonly string[] | null;
  seconds: number;
}

/** Place of the video: next to the 3-D view, in its corner, or instead of it. */
export type VideoPlace = (typeof PLACES)[number];
export const PLACES = ["beside", "inset", "large"] as const;

/** Parts of the page that can be hidden. None of them moves a robot. */
export const PANELS = ["video", "plots"] as const;
export type PanelName = (typeof PANELS)[number];

/** The 3-D view: a view's name, and where a person put its camera: eye and target [m, base frame]. */
export interface Camera {
  view: string;
  pose: readonly number[] | null;
}

export interface Layout {
  plots: readonly Plot[];
  /** The video's view; empty: the usual one. */
  video: string;
  place: VideoPlace;
  camera: Camera;
  hidden: readonly PanelName[];
}

/** What is wrong with a layout: a text's name and its values. */
export interface LayoutProblem {
  text:
    | "layout_long"
    | "layout_key"
    | "layout_plot"
    | "layout_plots"
    | "layout_video"
    | "layout_camera"
    | "layout_hide";
  values: Record<string, string | number>;
}

export const RANGES = [10, 60, 300, 600, 1800, 3600] as const;
export const MOST_PLOTS = 6;
/** Fields of one plot. */
export const MOST_FIELDS = 20;
export const LONGEST = 8000;
const LONGEST_FIELD = 200;
const SHOWN_LENGTH = 40;
const JOINTS = "joints";
const VIEW = /^[A-Za-z0-9][\w.-]{0,62}$/;
const FARTHEST_M = 1000;

export const DEFAULT_LAYOUT: Layout = {
  plots: [{ fields: null, seconds: 60 }],
  video: "",
  place: "beside",
  camera: { view: "free", pose: null },
  hidden: [],
};

/** Return a layout as text; empty: the default. */
export function layoutText(layout: Layout): string {
  const parts: string[] = [];
  const add = (key: string, values: readonly string[]) => parts.push(`${key}=${values.map(encoded).join(",")}`);
  if (JSON.stringify(layout.plots) !== JSON.stringify(DEFAULT_LAYOUT.plots)) {
    if (layout.plots.length === 0) add("plot", ["none"]);
    for (const { seconds, fields } of layout.plots) add("plot", [String(seconds), ...(fields ?? [JOINTS])]);
  }
  if (layout.video || layout.place !== DEFAULT_LAYOUT.place)
    add("video", [layout.video, ...(layout.place === DEFAULT_LAYOUT.place ? [] : [layout.place])]);
  const { view, pose } = layout.camera;
  if (pose) add("camera", [view, ...pose.map((each) => String(Number(each.toFixed(3))))]);
  else if (view !== DEFAULT_LAYOUT.camera.view) add("camera", [view]);
  if (layout.hidden.length) add("hide", layout.hidden);
  return parts.join("&");
}

/** Return the layout of a text, or the default one and what is wrong. */
export function readLayout(text: string): { layout: Layout; problem: LayoutProblem | null } {
  const wrong = (name: LayoutProblem["text"], values: LayoutProblem["values"] = {}) => ({
    layout: DEFAULT_LAYOUT,
    problem: { text: name, values },
  });
  if (text.length > LONGEST) return wrong("layout_long", { most: LONGEST });
  let layout = DEFAULT_LAYOUT;
  const plots: Plot[] = [];
  let noPlots = false;
  for (const part of text.split("&").filter(Boolean)) {
    const at = part.indexOf("=");
    const key = at < 0 ? part : part.slice(0, at);
    const values =
      at < 0
        ? []
        : part
            .slice(at + 1)
            .split(",")
            .map(decoded);
    const [first = "", ...rest] = values;
    const shown = values.join(",").slice(0, SHOWN_LENGTH);
    if (key === "plot") {
      if (first === "none" && rest.length === 0) noPlots = true;
      else {
        const plot = readPlot(first, rest);
        if (!plot) return wrong("layout_plot", { text: shown });
        plots.push(plot);
      }
      if (plots.length > MOST_PLOTS || (noPlots && plots.length)) return wrong("layout_plots", { most: MOST_PLOTS });
    } else if (key === "video") {
      const place = (rest[0] ?? "beside") as VideoPlace;
      if ((first && !VIEW.test(first)) || !PLACES.includes(place) || rest.length > 1)
        return wrong("layout_video", { text: shown });
      layout = { ...layout, video: first, place };
    } else if (key === "camera") {
      const pose = rest.map((each) => (each === "" ? NaN : Number(each)));
      const isPose = pose.length === 6 && pose.every((each) => Math.abs(each) <= FARTHEST_M) && !same(pose);
      if (!VIEW.test(first) || (pose.length > 0 && !isPose)) return wrong("layout_camera", { text: shown });
      layout = { ...layout, camera: { view: first, pose: isPose ? pose : null } };
    } else if (key === "hide") {
      if (!values.every((each) => PANELS.includes(each as PanelName))) return wrong("layout_hide", { text: shown });
      layout = { ...layout, hidden: PANELS.filter((each) => values.includes(each)) };
    } else return wrong("layout_key", { text: key.slice(0, SHOWN_LENGTH) });
  }
  if (noPlots || plots.length) layout = { ...layout, plots };
  return { layout, problem: null };
}

function readPlot(range: string, names: readonly string[]): Plot | null {
  const seconds = Number(range);
  if (!RANGES.some((each) => each === seconds && String(each) === range)) return null;
  if (names.length === 1 && names[0] === JOINTS) return { fields: null, seconds };
  const valid = names.every((name) => name.includes("/") && name.length <= LONGEST_FIELD && isPrintable(name));
  if (!valid || names.length > MOST_FIELDS || new Set(names).size < names.length) return null;
  return { fields: names, seconds };
}

function isPrintable(text: string): boolean {
  return !/[\p{Cc}\p{Cf}\p{Cs}\p{Z}]/u.test(text);
}

/** Return whether a camera's eye is at its target. */
function same([x, y, z, ...target]: readonly number[]): boolean {
  return Math.hypot((x ?? 0) - (target[0] ?? 0), (y ?? 0) - (target[1] ?? 0), (z ?? 0) - (target[2] ?? 0)) < 1e-3;
}

function encoded(text: string): string {
  return encodeURIComponent(text).replaceAll("%2F", "/");
}

function decoded(text: string): string {
  try {
    return decodeURIComponent(text);
  } catch {
    return "\0"; // not printable: refused
  }
}
