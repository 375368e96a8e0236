// Define in happy-dom: marks, problems, edits by keys, saving, and late answers.

import { act } from "preact/test-utils";
import { beforeEach, expect, test } from "vitest";
import { button, find, key, pass, press, send, texts, type } from "../../hands";
import { askedFor, field, go, hold, mesh, newDefine, refusal, robot, server } from "./server";

beforeEach(newDefine);

const invalid = (path: string) => find(field(path)).getAttribute("aria-invalid");
const value = (path: string) => find<HTMLInputElement>(field(path)).value;
const focused = () => (document.activeElement as HTMLElement).dataset;
const checks = () => texts(".check-list > *");
const joints = () => texts(".dh-table tbody th span:first-child");
const chain = () => texts(".chain-words strong");
const saveState = () => find(".save-state").textContent;
const outcomes = () => texts(".outcome > span:not(.shape), .outcome li");
const choose = (part: number | string) => click(`.chain-row[data-part="${part}"]`);
const click = (selector: string) => act(() => find(selector).click());
const tab = async (name: string) => {
  click(`#tab-${name}`);
  await pass(0);
};

test("an invalid position marks only its own field", async () => {
  await go("pt500");
  type(field("joint/2/position"), "x");
  expect(["2", "1"].map((joint) => invalid(`joint/${joint}/position`))).toEqual(["true", "false"]);
});

test("a problem of the server marks its fields, is told in the table, and is found again by a press", async () => {
  const text = "joint 'elbow' limits = [120, 110]: the lower must be below the upper";
  server["/check"] = ({ description }) => ({
    problems: description.joint[2].limits[0] > 110 ? [{ path: ["joint", 2, "limits"], text }] : [],
    tool: null,
  });
  await go("pt500");
  expect(checks()).toEqual(["Nothing is wrong with it."]);
  type(field("joint/2/limits/0"), "120");
  await pass(400);
  choose(2);
  expect([checks(), texts(".dh-problems li")]).toEqual([[text], [text]]);
  expect(["limits/0", "limits/1", "home"].map((each) => invalid(`joint/2/${each}`))).toEqual(["true", "true", "false"]);
  await tab("robot");
  press(text);
  await pass(100);
  expect(focused().path).toBe("joint/2/limits/0");
  type(field("joint/2/limits/0"), "-110");
  await pass(400);
  expect(checks()).toEqual(["Nothing is wrong with it."]);
});

test.each(["1,234", "0x10", ""])("what is no number (%o) stays marked and is not saved", async (typed) => {
  await go("pt500");
  const cell = field("joint/1/a");
  type(cell, typed);
  send(cell, new Event("blur"));
  expect([value("joint/1/a"), invalid("joint/1/a"), checks()[0]]).toEqual([
    typed,
    "true",
    expect.stringContaining("is no number: write it as 1234.5"),
  ]);
  press("Save");
  await pass(100);
  expect([askedFor("/save"), focused().path]).toEqual([[], "joint/1/a"]);
  key(cell, "Escape");
  expect([checks(), invalid("joint/1/a")]).toEqual([["Nothing is wrong with it."], "false"]);
});

test("a robot of the list is marked if it has an unsaved draft", async () => {
  const card = () => texts(".robot-card .dim");
  await go();
  expect(card()).toEqual(["library · 5 joints"]);
  await go("pt500");
  type(field("joint/1/a"), "260");
  await pass(2000);
  await go();
  expect(card()).toEqual(["library · 5 joints · unsaved draft"]);
});

const SHAPED = {
  ...robot("own", ["waist"], { base: { mesh: "meshes/base.wrl", mesh_scale: 1 } }),
  files: { "meshes/base.wrl": "b" },
};

test("a shape in the wrong unit is told", async () => {
  server["/robots/own"] = () => SHAPED;
  server["/mesh"] = () => mesh({ max: [0.1, 242, 0.1] });
  await go("own");
  expect(checks()).toEqual(["base.wrl is 242 m large: is the file’s unit right?"]);
  press("mm");
  await pass(400);
  expect(checks()).toEqual(["Nothing is wrong with it."]);
});

test("a shape that cannot be read is one problem, also with the server's, and its field is found", async () => {
  server["/robots/own"] = () => SHAPED;
  server["/mesh"] = () => refusal("meshes/base.wrl: it ends early");
  server["/check"] = () => ({ problems: [{ path: ["base", "mesh"], text: "meshes/base.wrl: it ends early" }] });
  await go("own");
  expect(checks()).toEqual(["meshes/base.wrl: it ends early"]);
  press(checks()[0] ?? "");
  await pass(100);
  expect(focused().path).toBe("base/mesh");
  type(field("joint/0/d"), "301");
  await pass(400);
  expect([checks(), texts("#tab-panel .problem-word")]).toEqual([checks(), checks()]);
  expect(checks()).toHaveLength(1);
});

test("checks go on when the console is there again", async () => {
  await go("pt500");
  const { "/check": check } = server;
  server["/check"] = () => Promise.reject(new Error("lost"));
  type(field("joint/1/a"), "260");
  await pass(400);
  expect(checks()).toEqual([expect.stringContaining("Not checked: this page has no connection to the console")]);
  server["/check"] = check as () => unknown;
  await pass(1600);
  expect(checks()).toEqual(["Nothing is wrong with it."]);
});

test("the keyboard removes and moves joints, and the focus follows; names by place change with it", async () => {
  await go("pt500");
  choose(1);
  key('.chain-row[data-part="1"]', "Delete");
  await pass(50);
  expect([chain(), focused().part]).toEqual([["Base", "waist", "elbow", "wrist", "roll", "Tool"], "1"]);
  press("Insert");
  expect(chain()).toEqual(["Base", "waist", "joint2", "elbow", "wrist", "roll", "Tool"]);
  key('.chain-row[data-part="1"]', "ArrowDown", { altKey: true });
  await pass(50);
  expect([chain().slice(2, 4), focused().part]).toEqual([["elbow", "joint3"], "2"]);
  expect(texts(".unseen[role=status]")).toContain("joint3 is joint 3 of 5.");
  type(field("joint/2/name"), "joint9");
  key('.chain-row[data-part="2"]', "ArrowUp", { altKey: true });
  expect(chain().slice(2, 4)).toEqual(["joint9", "elbow"]);
  key("body", "z", { ctrlKey: true });
  await pass(0);
  expect(chain().slice(2, 4)).toEqual(["elbow", "joint9"]);
  key("body", "Z", { ctrlKey: true, shiftKey: true });
  await pass(0);
  expect(chain().slice(2, 4)).toEqual(["joint9", "elbow"]);
});

async function paste(selector: string, text: string): Promise<void> {
  const clipboardData = { getData: () => text };
  send(selector, Object.assign(new Event("paste", { bubbles: true, cancelable: true }), { clipboardData }));
  await pass(0);
}

test("a table pasted into a cell is shown as it is read, fills the rows from there on, and is undone", async () => {
  await go("pt500");
  choose(1);
  await paste(field("joint/1/a"), `a (m)\td\tα\tmin\tmax\n0,25\t1,5\tx\t-30\t100\n${"0\t2\t90\t-9\t9\n".repeat(4)}`);
  const words = find(".paste-dialog [role=status]").textContent;
  for (const each of ["Row 2, α: “x” cannot be read as Link twist α.", "5 rows go into joints 2 to 6."])
    expect(words).toContain(each);
  expect(words).toContain("1 joint is added.");
  expect(find(".paste-dialog table").textContent).toContain("250 mm");
  send('.paste-dialog [aria-label="Lengths without a unit are in"] button:last-child', new Event("click"));
  press("Fill the table");
  expect(outcomes()).toEqual([expect.stringContaining("5 rows of the pasted table were read")]);
  expect(["a", "alpha", "d", "limits/0", "limits/1"].map((each) => value(`joint/1/${each}`))).toEqual([
    "250",
    "0",
    "1500",
    "−30",
    "100",
  ]);
  expect(joints()).toHaveLength(6);
  press("Undo");
  expect([joints().length, value("joint/1/limits/1")]).toEqual([5, "110"]);
});

test("a table with too many rows is refused", async () => {
  await go("pt500");
  press("Paste a table…");
  type(".paste-dialog textarea", "1\t2\n".repeat(10_000));
  expect(texts(".paste-dialog [role=alert]")).toEqual([expect.stringContaining("64 rows")]);
  expect(button("Fill the table").disabled).toBe(true);
});

test("frames, constraints and ignored pairs are saved", async () => {
  server["/collisions"] = () => ({ pairs: [{ links: ["base", "elbow"], kind: "apart", values: {} }] });
  await go("pt500");
  await tab("frames");
  press("Add frame");
  type(field("frame/0/name"), "camera");
  type(field("frame/0/xyz/1"), "100");
  await tab("constraints");
  press("Add constraint");
  await tab("collisions");
  await pass(100);
  click('[aria-label="Ignore base and elbow"]');
  await tab("robot");
  type(field("name"), "kept");
  press("Save");
  await pass(400);
  expect(askedFor("/save")).toMatchObject([
    {
      description: {
        name: "kept",
        frame: [{ name: "camera", link: "roll", xyz: [0, 100, 0] }],
        constraint: [{ joints: { shoulder: 1, elbow: 1 } }],
        collision: { ignore: [["base", "elbow"]] },
      },
      overwrite: false,
    },
  ]);
  expect([saveState(), location.hash]).toEqual(["Saved", "#/define/kept"]);
});

test("each pair of links shows how it is checked or why it is ignored, and is planned anew when it counts", async () => {
  const pair = (one: string, other: string, kind: string) => ({ links: [one, other], kind, values: {} });
  server["/collisions"] = ({ description }) => ({
    pairs: [
      pair("base", "waist", "adjacent"),
      pair("base", "elbow", description.joint[2].home === 100 ? "apart" : "touching"),
    ],
  });
  await go("pt500");
  await tab("collisions");
  await pass(100);
  const state = () => texts(".plan-state p");
  const rows = () => texts(".pairs tbody td:last-child");
  expect(state()).toEqual([expect.stringMatching(/^One checked pair touches/), "Pairs checked: 1, ignored: 1"]);
  expect(rows()).toEqual([
    expect.stringMatching(/^Convex hulls. They touch at home, as exact meshes too./),
    "Ignored. They are one joint apart.",
  ]);
  const box = (name: string) => find<HTMLInputElement>(`[aria-label="Ignore ${name}"]`);
  expect([box("base and waist").checked, box("base and waist").disabled]).toEqual([true, true]);
  click('[aria-label="Ignore base and elbow"]');
  expect([rows()[0], state()[0]]).toEqual(["Ignored. The description says so.", "At home no checked pair touches."]);
  click('[aria-label="Ignore base and elbow"]');
  expect(state()[0]).toMatch(/^One checked pair touches/);
  expect(askedFor("/collisions")).toHaveLength(1);
  choose(2);
  type(field("joint/2/home"), "100");
  await tab("collisions");
  await pass(1000);
  expect([state()[0], rows()[1]]).toEqual(["At home no checked pair touches.", "Convex hulls."]);
});

test("a plan of pairs that failed says why and is asked for again", async () => {
  server["/collisions"] = () => refusal("this took too long");
  await go("pt500");
  await tab("collisions");
  await pass(100);
  expect(texts("#tab-panel [role=alert] .problem-word")).toEqual([
    "How pairs are checked could not be worked out: this took too long",
  ]);
  server["/collisions"] = () => ({ pairs: [] });
  press("Try again");
  await pass(800);
  expect(texts("#tab-panel [role=alert]")).toEqual([]);
  expect(texts(".plan-state p")).toEqual(["Fewer than two links have a shape: there is nothing to check."]);
});

test("a robot that is not here is said", async () => {
  server["/robots/nobody"] = () => refusal("there is no robot 'nobody'", 404);
  await go("nobody");
  expect(outcomes()).toEqual(["nobody cannot be opened: there is no robot 'nobody'"]);
});

test("what somebody else saved meanwhile is asked about, and what this page saved is not", async () => {
  const { "/save": saved } = server;
  await go("own");
  await tab("robot");
  type(field("title"), "Own");
  press("Save");
  await pass(400);
  expect(askedFor("/save")).toMatchObject([{ revision: "r1", overwrite: false }]);
  server["/save"] = (body, query) => (body.overwrite ? saved?.(body, query) : refusal("own was changed", 409));
  type(field("title"), "Mine");
  press("Save");
  await pass(400);
  expect(texts("[role=alertdialog] span:not(.shape)")).toEqual(["own was changed. Save over it?"]);
  press("Cancel");
  press("Save");
  await pass(400);
  type(field("title"), "Mine after all");
  press("Save over it");
  await pass(400);
  expect(askedFor("/save").slice(1)).toMatchObject([
    { revision: "r2", overwrite: false, description: { title: "Mine" } },
    { revision: "r2", overwrite: false },
    { revision: "r2", overwrite: true, description: { title: "Mine after all" } },
  ]);
  expect(saveState()).toBe("Saved");
});

test("an agreement to save over one robot holds for no other", async () => {
  server["/save"] = () => refusal("own was changed", 409);
  await go("own");
  await tab("robot");
  type(field("title"), "Mine");
  press("Save");
  await pass(400);
  type(field("name"), "other");
  press("Save over it");
  await pass(400);
  expect(askedFor("/save").at(-1)).toMatchObject({ description: { name: "other" }, revision: "", overwrite: false });
});

test("a robot that is answered late does not replace the one opened meanwhile", async () => {
  server["/robots/two"] = () => robot("two", ["a", "b"]);
  const late = hold("/robots/pt500");
  await go("pt500");
  expect(texts(".define-loading")).toEqual(["Loading…"]);
  await go("two");
  await late();
  expect(joints()).toEqual(["a", "b"]);
});

test("a save that is answered late leaves the robot opened meanwhile as it is", async () => {
  await go();
  press("Start empty");
  await tab("robot");
  type(field("name"), "slow");
  const late = hold("/save");
  press("Save");
  await pass(100);
  expect(saveState()).toBe("Saving…");
  await go("pt500");
  history.replaceState(null, "", "#/define/pt500");
  await late();
  expect(outcomes()).toEqual(["slow is saved in robots/slow"]);
  expect([location.hash, saveState(), joints().length]).toEqual(["#/define/pt500", "No changes", 5]);
  button("Save and start simulated"); // the site does not have it: it must be saved first
  await go();
  expect(texts(".start-head button")).toEqual([]); // it is saved
});

test("an unsaved new draft is offered to the next page by its title", async () => {
  await go();
  press("Start empty");
  await tab("robot");
  type(field("title"), "Arm 0");
  click("a.action"); // New
  await pass(400);
  const [offer = ""] = texts(".start-head button");
  expect(offer).toMatch(/^Continue Arm 0, unsaved since/);
  press(offer);
  await pass(0);
  expect(texts("h1")).toEqual(["Arm 0"]);
});
