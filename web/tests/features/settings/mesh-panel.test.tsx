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
  const alive = (key: string) => say({ case: "presence", value: { key: `robomesh/${key}`, alive: true } });
  for (const key of ["yard/-/alive/console/1", "yard/-/alive/console/2", "yard/-/alive/store/1", "hall/-/alive/watch/1"])
    alive(key);
  publish("robomesh/hall/-/mesh", MeshStateSchema, { services: [{ site: "hall", service: "watch", id: "1" }] });
  await pass(1500);
  expect([texts("h3"), texts(".services"), texts("tbody tr").length]).toEqual([
    ["hall", "yard"],
    ["console ×2store"],
    1,
  ]);
});
