// Define's page before a server without a network: a test changes what it answers.

import { vi } from "vitest";
import { newPage } from "../../console";
import { pass, send } from "../../hands";
import { show } from "../../shown";

// biome-ignore lint/suspicious/noExplicitAny: each path has its own body.
type Answer = (body: any, query: URLSearchParams) => unknown;
/** What the server answers, by path: an object, or a `Response`. */
export const server: Record<string, Answer> = {};
/** The paths and bodies that it was asked for. */
export const asked: [path: string, body: unknown][] = [];
export const askedFor = (path: string) => asked.filter(([each]) => each === path).map(([, body]) => body);

export const mesh = (more = {}) => ({
  ...{ glb: "g", triangles: 12, min: [0, 0, 0], max: [0.1, 0.1, 0.1], points: [], warnings: [], missing: [] },
  ...{ scale: 1, up: "z", guess: "", ...more },
});
export const refusal = (text: string, status = 422) =>
  new Response(text, { status, headers: { "Content-Type": "text/plain" } });
const NAMES = ["waist", "shoulder", "elbow", "wrist", "roll"];
/** A robot as the server sends it. */
export const robot = (name: string, names = NAMES, more = {}) => ({
  description: { name, joint: names.map((joint) => ({ name: joint, limits: [-110, 110] })), ...more },
  files: {},
  notes: [],
  revision: "r1",
});

let page: typeof import("../../../src/features/define/define-page");
let place: HTMLElement;

/** Load a new page, with a server that has one robot of the library. */
export async function newDefine(): Promise<void> {
  newPage();
  asked.length = 0;
  for (const path of Object.keys(server)) delete server[path];
  Object.assign(server, {
    "/robots": () => ({ robots: [{ name: "pt500", origin: "library", joints: 5, running: false }], can_start: true }),
    "/robots/pt500": () => robot("pt500"),
    "/robots/own": () => robot("own"),
    "/check": () => ({ problems: [], tool: null }),
    "/files": (file: Blob, query: URLSearchParams) => ({ sha: query.get("name"), size: file.size }),
    "/mesh": () => mesh(),
    "/save": ({ description }: { description: { name: string } }) => ({
      ...{ name: description.name, folder: `robots/${description.name}`, revision: "r2" },
    }),
  } satisfies Record<string, Answer>);
  vi.stubGlobal("fetch", async (address: string, init: RequestInit = {}) => {
    const { pathname, searchParams } = new URL(address, "http://console");
    const path = pathname.replace("/define", "");
    const body = typeof init.body === "string" ? JSON.parse(init.body) : init.body;
    asked.push([path, body]);
    const answer = await (server[path] ?? (() => refusal("there is no such thing", 404)))(body, searchParams);
    return answer instanceof Response ? answer : Response.json(answer);
  });
  page = await import("../../../src/features/define/define-page");
  place = show(null);
}

/** Go to a robot's page, or to that of a new one. */
export async function go(name = ""): Promise<void> {
  show(<page.DefinePage name={name} />, place);
  await pass(400);
}

/** Let the server answer a path only when the returned function is called: only the first request waits. */
export function hold(path: string): () => Promise<void> {
  const answer = server[path] as Answer;
  let end: () => void = () => undefined;
  server[path] = (...given) => {
    server[path] = answer;
    return new Promise((resolve) => {
      end = () => resolve(answer(...given));
    });
  };
  return async () => {
    end();
    await pass(400);
  };
}

export const file = (name: string, text = name) => new File([text], name);

/** Drop files over the page. */
export async function drop(...files: File[]): Promise<void> {
  const dataTransfer = { types: ["Files"], items: [], files };
  send("main, .define", Object.assign(new Event("drop", { bubbles: true, cancelable: true }), { dataTransfer }));
  await pass(800);
}

/** The field of a value of the description, by the path that the server's problems have. */
export const field = (path: string) => `[data-path="${path}"]`;
