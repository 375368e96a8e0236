// The journal: what it can be narrowed to.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import { EventSchema } from "../../../src/gen/robomesh_pb";
import { connect, newPage, publish, say } from "../../console";
import { pass, texts } from "../../hands";
import { show } from "../../shown";

beforeEach(async () => {
  newPage();
  await connect({ site: "hall" });
  const { Journal } = await import("../../../src/features/events/journal");
  show(<Journal />);
  await pass();
});

test("the journal is narrowed to any site with a robot or an entry", async () => {
  say({ case: "presence", value: { key: "robomesh/hall/arm/alive/gateway/1", alive: true } });
  publish("robomesh/yard/-/events/watch", EventSchema, { timestamp: timestampFromMs(Date.now()), text: "x" });
  await pass(1500);
  expect(texts('select[aria-label="Site"] option')).toEqual(["All sites", "hall", "yard"]);
});
