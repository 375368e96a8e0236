// The services of every site: of a site without a watch, those that are present.

import { beforeEach, expect, test } from "vitest";
import { MeshStateSchema } from "../../../src/gen/robomesh_pb";
import { connect, newPage, publish, say } from "../../console";
import { pass, texts } from "../../hands";
import { show } from "../../shown";

beforeEach(async () => {
  newPage();
  await connect({ site: "hall" });
  const { MeshPanel } = await import("../../../src/features/settings/mesh-panel");
  show(<MeshPanel />);
});

test("a site without a watch has its present services, one with a watch what that reports", async () => {
  const alive = (site: string, id: string) =>
    say({ case: "presence", value: { key: `robomesh/${site}/-/alive/${id}`, alive: true } });
  for (const id of ["console/1", "console/2", "store/1"]) alive("yard", id);
  alive("hall", "watch/1");
  publish("robomesh/hall/-/mesh", MeshStateSchema, { services: [{ site: "hall", service: "watch", id: "1" }] });
  await pass(1500);
  expect([texts("h3"), texts(".services"), texts("tbody tr").length]).toEqual([
    ["hall", "yard"],
    ["console ×2store"],
    1,
  ]);
});
