// The page of one view for frames of other pages: no controls, and nothing old looks live.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { beforeEach, expect, test } from "vitest";
import { CompressedImageSchema } from "../../../src/gen/foxglove/CompressedImage_pb";
import { connect, newPage, publish } from "../../console";
import { find, pass, texts } from "../../hands";
import { show } from "../../shown";

let stream: typeof import("../../../src/mesh/console/view-stream");
const frame = () => [find("main").className, texts("[role=alert]")];
async function picture(): Promise<void> {
  publish("robomesh/s/r/image/front", CompressedImageSchema, {
    data: new Uint8Array(9),
    timestamp: timestampFromMs(1),
  });
  await pass(300);
}

beforeEach(async () => {
  newPage();
  stream = await import("../../../src/mesh/console/view-stream");
  const { ViewPage } = await import("../../../src/features/view/view-page");
  await connect({ site: "s", stale: [{ topic: "video/*", afterS: 1 }] });
  show(<ViewPage site="s" robot="r" view="front" />);
  await pass(300);
});

test("a live picture has its robot's name and nothing to press; one that stops is stale", async () => {
  expect(frame()).toEqual(["frame stale", [expect.stringMatching(/picture/)]]);
  await picture();
  expect([frame(), texts(".frame-name"), find<HTMLImageElement>("img").alt]).toEqual([
    ["frame", []],
    ["s/r"],
    "r, Front",
  ]);
  expect(texts("a, button, input, form, [onclick], [tabindex]")).toEqual([]);
  await pass(1500);
  expect(frame()).toEqual(["frame stale", [expect.stringContaining("stale")]]);
});

test("a view that the console refuses says why, over the last picture", async () => {
  await picture();
  stream.refused.value = "the token is revoked";
  await pass();
  expect(frame()).toEqual(["frame stale", [expect.stringContaining("the token is revoked")]]);
});
