// The layout of a robot's page in its address.

import { expect, test } from "vitest";
import type { Layout } from "../../../src/ui/page/layout";
import { DEFAULT_LAYOUT, layoutText, readLayout } from "../../../src/ui/page/layout";

const POSE = [1, 2, 3, 0, 0, 0.5];

test.each<[string, Partial<Layout>]>([
  ["", {}],
  ["plot=none", { plots: [] }],
  [
    "plot=60,joints&plot=600,joints/waist/position,kinematics/tool/x",
    {
      plots: [
        { fields: null, seconds: 60 },
        { fields: ["joints/waist/position", "kinematics/tool/x"], seconds: 600 },
      ],
    },
  ],
  ["plot=60,a/%E5%85%B3%2C%26", { plots: [{ fields: ["a/关,&"], seconds: 60 }] }],
  ["video=front", { video: "front" }],
  ["video=,large", { place: "large" }],
  ["video=front,inset", { video: "front", place: "inset" }],
  ["camera=top", { camera: { view: "top", pose: null } }],
  ["camera=free,1,2,3,0,0,0.5", { camera: { view: "free", pose: POSE } }],
  ["hide=video,plots", { hidden: ["video", "plots"] }],
])("the layout %o is written and read as the same", (text, more) => {
  const layout = { ...DEFAULT_LAYOUT, ...more };
  expect(layoutText(layout)).toBe(text);
  expect(readLayout(text)).toEqual({ layout, problem: null });
});

test("a pose is written in millimetres, and hidden panels have one order", () => {
  const pose = [1.00049, -2.0006, 0, 0, 0, 0];
  expect(layoutText({ ...DEFAULT_LAYOUT, camera: { view: "free", pose } })).toBe("camera=free,1,-2.001,0,0,0,0");
  expect(readLayout("hide=plots,video").layout.hidden).toEqual(["video", "plots"]);
});

const many = (count: number, of: (i: number) => string, joint = "&") =>
  Array.from({ length: count }, (_, i) => of(i)).join(joint);
const field = (i: number) => `joints/j${i}/position`;

test.each([
  ["too long a text", "x".repeat(8001), "layout_long", { most: 8000 }],
  ["an unknown key", `${"x".repeat(50)}=1`, "layout_key", { text: "x".repeat(40) }],
  ["a key without a value", "plots", "layout_key", { text: "plots" }],
  ["an unknown time range", "plot=61,joints", "layout_plot", { text: "61,joints" }],
  ["a time range in another form", "plot=60.0,joints", "layout_plot", { text: "60.0,joints" }],
  ["a value without a topic", "plot=60,waist", "layout_plot", { text: "60,waist" }],
  ["a value that cannot be printed", "plot=60,a/%E2%80%AE", "layout_plot", { text: "60,a/\u202e" }],
  ["a malformed value", "plot=60,a/%E2", "layout_plot", { text: "60,\0" }],
  [
    "a value of more than 200 letters",
    `plot=60,a/${"b".repeat(199)}`,
    "layout_plot",
    { text: `60,a/${"b".repeat(35)}` },
  ],
  ["a value twice", "plot=60,a/b,a/b", "layout_plot", { text: "60,a/b,a/b" }],
  [
    "more than 20 values",
    `plot=60,${many(21, field, ",")}`,
    "layout_plot",
    { text: expect.stringMatching(/^60,joints/) },
  ],
  ["more than 6 plots", many(7, () => "plot=60,joints"), "layout_plots", { most: 6 }],
  ["no plots and a plot", "plot=none&plot=60,joints", "layout_plots", { most: 6 }],
  ["an unknown place of the video", "video=front,below", "layout_video", { text: "front,below" }],
  ["two places of the video", "video=front,large,inset", "layout_video", { text: "front,large,inset" }],
  ["a view that no robot has", "video=a/b", "layout_video", { text: "a/b" }],
  ["a camera without a view", "camera=", "layout_camera", { text: "" }],
  ["a pose of five numbers", "camera=free,1,2,3,4,5", "layout_camera", { text: "free,1,2,3,4,5" }],
  ["a pose with an empty number", "camera=free,1,,3,4,5,6", "layout_camera", { text: "free,1,,3,4,5,6" }],
  ["a pose beyond 1 km", "camera=free,1001,0,0,0,0,0", "layout_camera", { text: "free,1001,0,0,0,0,0" }],
  ["an eye at its target", "camera=free,1,2,3,1,2,3.0009", "layout_camera", { text: "free,1,2,3,1,2,3.0009" }],
  ["a hidden panel that moves the robot", "hide=control", "layout_hide", { text: "control" }],
])("%s is named, and the page has its default layout", (_, text, name, values) => {
  expect(readLayout(text)).toEqual({ layout: DEFAULT_LAYOUT, problem: { text: name, values } });
});

test.each([
  many(6, () => "plot=60,joints"),
  `plot=60,${many(20, field, ",")}`,
  `plot=60,a/${"b".repeat(198)}`,
  "camera=free,1000,0,0,0,0,0",
  "camera=free,1,2,3,1,2,3.002",
  "&hide=video&",
])("at its limit a layout is taken (%o)", (text) => {
  expect(readLayout(text).problem).toBeNull();
});
