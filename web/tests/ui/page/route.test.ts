// The page that an address names.

import { beforeEach, expect, test, vi } from "vitest";

let page: typeof import("../../../src/ui/page/route");
beforeEach(async () => {
  vi.resetModules();
  location.hash = "";
  page = await import("../../../src/ui/page/route");
});

function go(hash: string) {
  location.hash = hash;
  dispatchEvent(new Event("hashchange"));
  return page.route.value;
}
const ARM = { site: "hall", robot: "arm" };
const REPLAY = { site: "hall", robot: "replay-1" };

test.each([
  ["", { page: "fleet" }],
  ["#/", { page: "fleet" }],
  ["#/hall", { page: "fleet" }],
  ["#/events", { page: "events" }],
  ["#/settings?x", { page: "settings" }],
  ["#/hall/arm", { page: "robot", robot: ARM }],
  ["#/hall/arm?hide=video", { page: "robot", robot: ARM }],
  ["#/ha%6Cl/arm", { page: "robot", robot: ARM }],
  ["#/hall/a%E2", { page: "robot", robot: { site: "hall", robot: "a%E2" } }],
  ["#/program", { page: "program", robot: null, sha256: "" }],
  ["#/program/hall/arm", { page: "program", robot: ARM, sha256: "" }],
  ["#/program/hall/arm/ab12", { page: "program", robot: ARM, sha256: "ab12" }],
  ["#/program/hall/replay-1", { page: "robot", robot: REPLAY }],
  ["#/cell/hall/arm", { page: "cell", robot: ARM }],
  ["#/cell/hall/replay-1", { page: "robot", robot: REPLAY }],
  ["#/cell/hall", { page: "fleet" }],
  ["#/define", { page: "define", name: "" }],
  ["#/define/my%20arm", { page: "define", name: "my arm" }],
  ["#/recordings", { page: "recordings", recordings: [] }],
  ["#/recordings/hall/a.mcap", { page: "recordings", recordings: [{ site: "hall", file: "a.mcap" }] }],
  [
    "#/recordings/hall/a.mcap/mill/b.mcap/hall/c.mcap",
    {
      page: "recordings",
      recordings: [
        { site: "hall", file: "a.mcap" },
        { site: "mill", file: "b.mcap" },
      ],
    },
  ],
  ["#/wall", { page: "wall", views: [] }],
  ["#/wall/hall/arm/front/hall/arm", { page: "wall", views: [{ ...ARM, view: "front" }] }],
  // The console would close the page's connection.
  [
    "#/wall/hall/arm/fr*nt/Hall/arm/front/hall/arm2/top",
    { page: "wall", views: [{ site: "hall", robot: "arm2", view: "top" }] },
  ],
])("the address %o leads to its page", (hash, route) => {
  expect(go(hash)).toEqual(route);
});

test("each link leads back to what it names", () => {
  const recordings = [{ site: "hall", file: "a b/1.mcap" }];
  const views = [{ ...ARM, view: "front" }];
  expect(go(page.robotLink("hall", "arm"))).toEqual({ page: "robot", robot: ARM });
  expect(go(page.programLink("hall", "arm"))).toEqual({ page: "program", robot: ARM, sha256: "" });
  expect(go(page.programLink("hall", "arm", "ab"))).toMatchObject({ sha256: "ab" });
  expect(go(page.cellLink("hall", "arm"))).toEqual({ page: "cell", robot: ARM });
  expect(go(page.recordingsLink(...recordings))).toEqual({ page: "recordings", recordings });
  expect(go(page.wallLink(views))).toEqual({ page: "wall", views });
});

test("a robot's pages are about it, and no other page is about a robot", () => {
  const robots = ["#/hall/arm", "#/program/hall/arm", "#/cell/hall/arm", "#/program", "#/wall/hall/arm/front"];
  expect(robots.map((hash) => page.robotOf(go(hash)))).toEqual([ARM, ARM, ARM, null, null]);
});

test("a layout is in the address, belongs to its page, and adds no step to go back", () => {
  go("#/hall/arm?hide=video");
  expect(page.layoutQuery.value).toBe("hide=video");
  const steps = history.length;
  page.setLayoutQuery("hide=plots");
  expect([location.hash, page.layoutQuery.value]).toEqual(["#/hall/arm?hide=plots", "hide=plots"]);
  page.setLayoutQuery("");
  expect([location.hash, page.layoutQuery.value, history.length]).toEqual(["#/hall/arm", "", steps]);
  go("#/hall/arm2");
  expect(page.layoutQuery.value).toBe("");
});
