// The recording of a real site reaches the page's stores as it would in a browser.

import { fromBinary } from "@bufbuild/protobuf";
import { beforeEach, expect, test } from "vitest";
import { JointStatesSchema } from "../src/gen/foxglove/JointStates_pb";
import { connect, newPage, sockets, watched } from "./console";
import { ARM, payloads, replay } from "./recorded";

beforeEach(async () => {
  newPage();
  await connect();
});

test("each recorded state arrives, in order, at who watches it", async () => {
  const { watch } = await import("../src/mesh/console/connection");
  const got: Uint8Array[] = [];
  watch(`${ARM}/joints`, (sample) => got.push(sample.payload));
  expect(watched).toContain(`${ARM}/joints`);
  await replay();
  expect(got.map((each) => fromBinary(JointStatesSchema, each).joints.length)).toEqual(
    payloads(`${ARM}/joints`).map(() => 5),
  );
  expect(sockets.map((each) => each.path)).toEqual(["/mesh", "/mesh/stop"]);
});
