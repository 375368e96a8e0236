// Refusals of the console's HTTP requests, in the page's language.

import { create } from "@bufbuild/protobuf";
import type { Reason } from "../../gen/robomesh_pb";
import { ReasonSchema } from "../../gen/robomesh_pb";
import { reasonText } from "../../i18n/reasons";

/** A refused HTTP request; the message is the reason in the page's language, or the console's English sentence. */
export class RefusedRequest extends Error {
  constructor(
    /** 0: no answer. */
    readonly status: number,
    text: string,
    readonly reason?: Reason,
    /** The whole answer, if it is a JSON object. */
    readonly reply: Readonly<Record<string, unknown>> = {},
  ) {
    super(reasonText(reason, text));
  }
}

/** The message `Reason` in JSON. */
interface ReasonJson {
  code: string;
  values: Record<string, string>;
  causes: ReasonJson[];
  text: string;
}

/** Read the refusal in an answer: JSON, or a sentence with the reason's parameters in the content type. */
export async function readRefusal(answer: Response): Promise<RefusedRequest> {
  const type = answer.headers.get("Content-Type") ?? "";
  const body = await answer.text().catch(() => "");
  if (type.startsWith("application/json")) {
    const reply = asObject(body);
    const text = typeof reply.text === "string" ? reply.text : `HTTP ${answer.status}`;
    const reason = reply.refusal ? create(ReasonSchema, reply.refusal as ReasonJson) : undefined;
    return new RefusedRequest(answer.status, text, reason, reply);
  }
  // A proxy's error is a page.
  const text = (type.startsWith("text/plain") && body) || `HTTP ${answer.status}`;
  const parameters = /;\s*refusal="([^"]*)"/.exec(type)?.[1] ?? "";
  return new RefusedRequest(answer.status, text, reasonOf([...new URLSearchParams(parameters)], text));
}

function asObject(text: string): Record<string, unknown> {
  try {
    const found: unknown = JSON.parse(text);
    return typeof found === "object" && found !== null ? { ...found } : {};
  } catch {
    return {};
  }
}

const CAUSE = "cause.";

/** Undefined: the parameters have no code. */
function reasonOf(pairs: readonly (readonly [string, string])[], text: string): Reason | undefined {
  const values = Object.fromEntries(pairs.filter(([name]) => !name.startsWith(CAUSE)));
  const { code, ...others } = values;
  if (!code) return undefined;
  const ofCause = pairs.filter(([name]) => name.startsWith(CAUSE));
  const cause = reasonOf(
    ofCause.map(([name, value]) => [name.slice(CAUSE.length), value] as const),
    "",
  );
  return create(ReasonSchema, { code, values: others, causes: cause ? [cause] : [], text });
}
