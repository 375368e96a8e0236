// Requests to a robot's recorder: start, stop, keep the last minutes.

import type { Recording } from "../../gen/robomesh_pb";
import { RecorderRequest_Action as Action, RecorderRequestSchema, RecordingSchema } from "../../gen/robomesh_pb";
import { recordingsText as r } from "../../i18n/texts";
import { ask, withNoAnswerText } from "../console/connection";

// Closing rewrites the file.
const TIMEOUT_S = 20;

/** Send a request to a robot's recorder.
 *
 * @throws Error with the reason in words. */
export async function askRecorder(
  robotKey: string,
  action: Action,
  values: { name?: string; views?: string[] } = {},
): Promise<Recording> {
  const request = { action, ...values };
  const answer = ask(`${robotKey}/recorder/request`, RecorderRequestSchema, request, RecordingSchema, TIMEOUT_S);
  return await withNoAnswerText(answer, r("record_no_answer"));
}

export { Action };
