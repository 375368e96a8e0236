// Presence of a robot's services, and of the robot itself.

import { beforeEach, expect, test } from "vitest";
import { connect, newPage, say } from "../console";
import { find, pass, texts } from "../hands";
import { show } from "../shown";

let found: typeof import("../../src/panels/robot-not-found");
let connection: typeof import("../../src/mesh/console/connection");

beforeEach(async () => {
  newPage();
  found = await import("../../src/panels/robot-not-found");
  connection = await import("../../src/mesh/console/connection");
});

async function announce(...keys: string[]): Promise<void> {
  for (const key of keys) say({ case: "presence", value: { key: `robomesh/${key}`, alive: true } });
  await pass(30);
}

test("live services are named once, in order, with their number, without the operator in control", async () => {
  const { AliveServices } = await import("../../src/panels/alive-services");
  await connect();
  show(<AliveServices of="robomesh/hall/arm" />);
  expect(texts(".services")).toEqual(["no service seen"]);
  await announce(
    ...["planner/1", "gateway/1", "planner/2", "operator/li"].map((each) => `hall/arm/alive/${each}`),
    "hall/arm2/alive/renderer/1",
  );
  expect(texts(".services span")).toEqual(["gateway", "planner ×2"]);
});

function Search(props: { robot: string; known?: boolean }) {
  const search = found.useRobotSearch(`robomesh/hall/${props.robot}`, props.known ?? false);
  return search === "found" ? <b>found</b> : <found.NoRobot site="hall" robot={props.robot} search={search} />;
}
const says = () => texts("b, p.looking, h1")[0];
const LOOKING = "Looking for arm at hall…";
const MISSING = "There is no robot arm at hall.";

test("a robot is missing as soon as a console that knows every robot does not know it", async () => {
  show(<Search robot="arm" />);
  expect(says()).toBe(LOOKING);
  await connect();
  await pass(0);
  expect(says()).toBe(MISSING);
  expect(texts(".missing > p, a")).toEqual(["No robot is on the mesh now."]);
});

test("while a console may not know every robot, the page looks for 4 s", async () => {
  await connect({ presenceKnown: false });
  show(<Search robot="arm" />);
  await pass(3900);
  expect(says()).toBe(LOOKING);
  await pass(200);
  expect(says()).toBe(MISSING);
  await announce("hall/other/alive/gateway/1");
  expect(texts(".missing > p, a")).toEqual(["There are:", "hall / other"]);
  expect(find("a").getAttribute("href")).toBe("#/hall/other");
  await announce("hall/arm/alive/gateway/1");
  expect(says()).toBe("found");
});

test.each([
  ["a console without a mesh", () => connect({ connected: false })],
  ["a lost connection", async () => (await connect({ presenceKnown: false }), void (connection.lostAt.value = 1))],
])("%s never makes a robot missing", async (_, begin) => {
  await begin();
  show(<Search robot="arm" />);
  await pass(10_000);
  expect(says()).toBe(LOOKING);
});

test("a replay announces no presence: it is looked for, and found by what it sends", async () => {
  await connect();
  const place = show(<Search robot="replay-1" />);
  await pass(1000);
  expect(says()).toBe("Looking for replay-1 at hall…");
  show(<Search robot="replay-1" known />, place);
  expect(says()).toBe("found");
});

test("a robot that was found stays, and another one is looked for anew", async () => {
  await connect({ presenceKnown: false });
  const place = show(<Search robot="arm" known />);
  show(<Search robot="arm" />, place);
  await pass(5000);
  expect(says()).toBe("found");
  show(<Search robot="other" />, place);
  await pass(5000);
  expect(says()).toBe("There is no robot other at hall.");
});
