// Files dropped over Define: links, parts, a URDF and its files, and refusals.

import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { find, pass, press, send, texts, type } from "../../../hands";
import { askedFor, drop, field, file, go, hold, mesh, newDefine, refusal, robot, server } from "../server";

const kept = new Map<string, Blob>();
beforeEach(async () => {
  kept.clear();
  vi.doMock("../../../../src/features/define/draft/file-cache", () => ({
    cacheFile: async (sha: string, bytes: Blob) => void kept.set(sha, bytes),
    cachedFile: async (sha: string) => kept.get(sha),
    deleteOtherFiles: async () => undefined,
  }));
  await newDefine();
});

const notices = () => texts(".file-notices li");
const chain = () => texts(".chain-words .dim");
const joints = () => texts(".dh-table tbody th span:first-child");
const missing = () => texts(".missing-files li, .missing-files h2 + p");

/** Take files into a button's file dialog. */
async function take(input: string, ...files: File[]): Promise<void> {
  const of = find<HTMLInputElement>(input);
  Object.defineProperty(of, "files", { value: files, configurable: true });
  await act(() => void of.dispatchEvent(new Event("change", { bubbles: true })));
}

test("a file that another refers to is asked for by name, and is a part of it rather than a link", async () => {
  server["/mesh"] = ({ files }) => mesh({ missing: files["meshes/part.wrl"] ? [] : ["part.wrl"] });
  await go();
  await drop(file("outer.wrl"));
  expect(missing()).toEqual(["meshes/outer.wrl refers to part.wrl"]);
  await drop(file("part.wrl"));
  expect([missing(), joints(), chain()[0]]).toEqual([[], [], "outer.wrl"]);
});

test("a file that cannot be read is refused by name, and the others are taken", async () => {
  server["/mesh"] = ({ file: name }) => (name.endsWith("bad.3ds") ? refusal("it ends early") : mesh());
  await go();
  await drop(file("base.wrl"), file("bad.3ds"));
  expect([notices(), chain()[0], joints()]).toEqual([["bad.3ds: it ends early"], "base.wrl", []]);
  expect(find(".outcome").getAttribute("role")).toBe("alert");
});

test.each([
  ["notes.txt", "There is no mesh file, URDF or zip among them."],
  ["part.off", "part.off: OFF is not supported"],
  ["part.wrl.gz", "part.wrl.gz: GZ is not supported"],
  [
    "arm.urdf.xacro",
    "arm.urdf.xacro is a template, not a URDF. Convert it (xacro FILE > robot.urdf), and drop the URDF together with the meshes.",
  ],
])("of %s nothing can be made, and the page says why", async (name, says) => {
  server["/mesh"] = ({ file: path }) => refusal(`${path.split(".").at(-1).toUpperCase()} is not supported`);
  await go();
  await drop(file(name));
  expect([notices(), texts(".chain-row")]).toEqual([[says], []]);
});

const VISUAL = ["base", "arm"].map((link) => `package://two/meshes/visual/${link}.stl`);
const COLLISION = ["base", "arm"].map((link) => `package://two/meshes/collision/${link}.stl`);
const at = (address: string) => address.replace("package://", "");
/** Let the server read a URDF whose links have two files of the same name, in two folders. */
function twoLinks(): void {
  server["/import"] = ({ files }) => ({
    ...robot("two", ["turn"], { base: { mesh: "meshes/base.stl" } }),
    missing: [...VISUAL, ...COLLISION].filter((address) => !files[at(address)]),
  });
  server["/files"] = (given, query) => ({ sha: `${query.get("name")} of ${given.size}`, size: given.size });
}

test("a URDF and files of one name are read in one drop: the finer one is seen, and unused ones are named", async () => {
  twoLinks();
  await go();
  const links = ["base", "arm"].flatMap((link) => [9, 31].map((size) => file(`${link}.stl`, "x".repeat(size))));
  await drop(file("two.urdf"), ...links, file("spare.stl"), file("notes.txt"));
  expect(notices()).toEqual([
    "Not used by this robot: spare.stl, notes.txt.",
    "two.urdf read: 4 of its 4 mesh files found.",
  ]);
  expect(askedFor("/import").at(-1)).toMatchObject({
    files: {
      "two/meshes/visual/base.stl": "base.stl of 31",
      "two/meshes/collision/base.stl": "base.stl of 9",
      "two/meshes/visual/arm.stl": "arm.stl of 31",
      "two/meshes/collision/arm.stl": "arm.stl of 9",
    },
  });
  expect(joints()).toEqual(["turn"]);
});

test("found and missing files of a URDF are counted, and the URDF waits for them", async () => {
  twoLinks();
  await go();
  await drop(file("two.urdf"), file("base.stl"));
  expect(missing()[0]).toBe("2 mesh files found, 2 missing."); // without a second file, the one serves both
  await drop(file("arm.stl"));
  expect([missing(), notices()]).toEqual([[], ["two.urdf read: 4 of its 4 mesh files found."]]);
});

test("a robot of OpenHRP is chosen as one, and otherwise its file is a link", async () => {
  server["/import"] = () => ({ ...robot("arm", ["turn"]), missing: [] });
  await go();
  await take('[aria-label="From a URDF or a zip"] input', file("arm.wrl"));
  await pass(800);
  expect([askedFor("/import").at(-1), joints()]).toEqual([
    { file: "arm.wrl", files: { "arm.wrl": "arm.wrl" } },
    ["turn"],
  ]);
});

test("a file that is read late is not put into the robot opened meanwhile", async () => {
  await go("pt500");
  const late = hold("/mesh");
  await drop(file("late.wrl"));
  await go("own");
  await late();
  await drop(file("mine.wrl"));
  expect([joints().length, chain().at(-2)]).toEqual([6, "mine · mine.wrl"]);
  press("Undo");
  expect(find(".save-state").textContent).toBe("Saved");
});

test("two shapes chosen in a row are both kept, however late the first is read", async () => {
  await go();
  press("Start empty");
  const late = hold("/mesh");
  await take("#tab-panel input[type=file]", file("base.wrl"));
  await pass(100);
  send('.chain-row[data-part="0"]', new Event("click", { bubbles: true }));
  await take("#tab-panel input[type=file]", file("column.3ds"));
  await pass(100);
  await late();
  expect(chain().slice(0, 2)).toEqual(["base.wrl", "column.3ds"]);
});

test("files that the server forgot are sent again", async () => {
  await go();
  await drop(file("base.wrl"));
  const { "/check": check } = server;
  let forgotten = true;
  server["/files"] = (_, query) => {
    forgotten = false;
    return { sha: query.get("name")?.replace("meshes/", ""), size: 1 };
  };
  server["/check"] = (...given) => (forgotten ? refusal("forgotten", 410) : check?.(...given));
  press("+ Add joint");
  type(field("joint/0/d"), "77");
  await pass(400);
  expect([forgotten, texts(".check-list > *")]).toEqual([false, ["Nothing is wrong with it."]]);
});
