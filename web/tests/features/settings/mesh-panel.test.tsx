// The services of every site, as its watch reports them; of a site without a watch, those that are present.

import { beforeEach, expect, test } from "vitest";
import { MeshStateSchema } from "../../../src/gen/robomesh_pb";
import { connect, newPage, publish, say } from "../../console";
import { pass, texts } from "../../hands";
import { show } from "../../shown";

beforeEach(async () => {
  newPage();
  await connect({ site: "hall", stale: [{ topic: "health/*", afterS: 10 }] });
  const { SettingsPage } = await import("../../../src/features/settings/settings-page");
  show(<SettingsPage />);
});

test("a site without a watch has its present services, one with a watch what that reports", async () => {
  const alive = (key: string) => say({ case: "presence", value: { key: `robomesh/${key}`, alive: true } });
  for (const key of [
    "yard/-/alive/console/1",
    "yard/-/alive/console/2",
    "yard/-/alive/store/1",
    "hall/-/alive/watch/1",
  ])
    alive(key);
  publish("robomesh/hall/-/mesh", MeshStateSchema, { services: [{ site: "hall", service: "watch", id: "1" }] });
  await pass(1500);
  expect([texts(".site-seen h3"), texts(".site-seen .services"), texts(".seen-table tbody tr").length]).toEqual([
    ["hall", "yard"],
    ["console ×2store"],
    1,
  ]);
});

const RENDERER = { site: "hall", service: "renderer", id: "r1", host: "cell-9", version: "0.0.9", ageS: 0 };
async function report(...services: object[]): Promise<void> {
  publish("robomesh/hall/-/mesh", MeshStateSchema, { services });
  await pass(300);
}
const cells = () => texts(".seen-table tbody tr > *").slice(0, 4);

test("a service that is silent or gone stays in the list, and says so", async () => {
  await report(RENDERER);
  expect(cells()).toEqual(["renderer", expect.not.stringMatching(/gone|silent/), "cell-9", "0.0.9"]);
  await report({ ...RENDERER, ageS: 20 });
  expect(cells()[1]).toMatch(/^silent /);
  await report();
  expect(cells().slice(0, 2)).toEqual(["renderer", expect.stringMatching(/^gone since /)]);
});

test("a certificate's end is told in days", async () => {
  await report({ ...RENDERER, values: { certificate_seconds: 3.5 * 86_400 } });
  expect(texts('[aria-label="Certificates"] li')).toEqual([expect.stringMatching(/ends in 3\sd$/)]);
});
