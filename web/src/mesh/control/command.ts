// Commands to the robot that this tab controls.

import type { MessageInitShape } from "@bufbuild/protobuf";
import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { signal } from "@preact/signals";
import type { JogSchema, RecoverSchema } from "../../gen/robomesh_pb";
import { CommandRequest_Command as Command, CommandAnswerSchema, CommandRequestSchema } from "../../gen/robomesh_pb";
import { reasonText } from "../../i18n/reasons";
import { t } from "../../i18n/texts";
import { ask, reasonOf } from "../console/connection";
import type { Notice } from "./control";
import { controlNotice, heldLease } from "./control";
import { pageReport, whyFrozen } from "./display-freshness";

/** Values of a command beyond its name. */
export interface CommandValues {
  jointPositions?: number[];
  speedPercent?: number;
  stopId?: bigint;
  program?: string;
  programName?: string;
  jog?: MessageInitShape<typeof JogSchema>;
  recover?: MessageInitShape<typeof RecoverSchema>;
}

const VALID_MS = 1000;
const ANSWERED_S = 2;
// The gateway checks a program before it answers, and does not start it after this timeout.
const CHECKED_S = 30;
const MOTIONS: readonly Command[] = [
  Command.HOME,
  Command.MOVE_ABSOLUTE,
  Command.MOVE_RELATIVE,
  Command.RUN_PROGRAM,
  Command.JOG,
];
const STARTS_MOTION: readonly Command[] = [...MOTIONS, Command.RESUME];

/** Return the id of the newest command of this page. */
export const newestCommand = (): bigint => lastId;

// Sequence numbers rise within a lease, so one counter serves all leases.
let lastId = 0n;
/** Number of the newest accepted motion; it supersedes all earlier ones. */
export const newestMotion = signal(0n);

/** Send a command under the lease; return the outcome in words. Never sends without control.
 *
 * `positions`: the motion's target joints [rad] or [m], if it has one. */
export async function command(
  robotKey: string,
  name: Command,
  what: string,
  values: CommandValues = {},
  tell: (notice: Notice) => void = (notice) => (controlNotice.value = notice),
  positions = name === Command.MOVE_ABSOLUTE ? values.jointPositions : undefined,
): Promise<boolean> {
  const mine = heldLease.value;
  const refuse = (text: string) => {
    tell({ kind: "refused", text: t("not_sent", { text }) });
    return false;
  };
  if (mine?.robotKey !== robotKey) return refuse(t("take_first"));
  const frozen = STARTS_MOTION.includes(name) ? whyFrozen(robotKey) : "";
  if (frozen) return refuse(frozen);
  const page = pageReport(robotKey);
  tell({ kind: "busy", text: t("sending", { what }) });
  const [validMs, withinS] = name === Command.RUN_PROGRAM ? [CHECKED_S * 1000, CHECKED_S] : [VALID_MS, ANSWERED_S];
  const request = {
    lease: mine.lease,
    id: ++lastId,
    notAfter: timestampFromMs(Math.floor(performance.now() + mine.clockMs + validMs)),
    command: name,
    ...(page && { page }),
    ...values,
  };
  try {
    const key = `${robotKey}/command/${mine.operator}`;
    const answer = await ask(key, CommandRequestSchema, request, CommandAnswerSchema, withinS);
    const target = positions && { what, positions, id: request.id };
    if (!answer.accepted) return refuse(answer.text);
    if (MOTIONS.includes(name)) newestMotion.value = request.id;
    // Older gateways put the warning only into their sentence.
    const warning = reasonText(answer.warning, answer.text.split("; mind: ")[1]);
    tell({ kind: "done", text: t("sent", { what }), ...(warning && { warning }), ...(target && { target }) });
    return true;
  } catch (error) {
    return refuse(ended(reasonOf(error)));
  }
}

/** Return a sentence with its full stop. */
const ended = (text: string): string => (/[.。]$/.test(text) ? text : t("sentence", { text }));

export { Command };
