// Requests that change a recording: name, note, tags, deletion.

import type { MessageInitShape } from "@bufbuild/protobuf";
import type { Recording } from "../../../gen/robomesh_pb";
import { RecordingRequest_Action as Action, RecordingRequestSchema, RecordingSchema } from "../../../gen/robomesh_pb";
import { ask, inOwnName } from "../../../mesh/console/connection";
import type { Row } from "./recordings-of-sites";
import { refreshSite } from "./recordings-of-sites";

// The recorder hashes a file before it deletes it.
const TIMEOUT_S = 60;

/** Change a recording and refresh the list.
 *
 * @throws AskError with the reason in words. */
async function change(row: Row, request: MessageInitShape<typeof RecordingRequestSchema>): Promise<Recording> {
  const { site, recording } = row;
  const key = inOwnName(`robomesh/${site}/-/recordings/request`);
  const whole = { ...request, file: recording.file };
  const answer = await ask(key, RecordingRequestSchema, whole, RecordingSchema, TIMEOUT_S);
  refreshSite(site);
  return answer;
}

export interface Labels {
  name: string;
  note: string;
  tags: readonly string[];
}

/** Save the labels that differ from the recording's; each is a change of its own. */
export async function saveLabels(row: Row, labels: Labels): Promise<void> {
  const { recording } = row;
  let basedOn = recording.changes;
  const save = async (request: MessageInitShape<typeof RecordingRequestSchema>) => {
    basedOn = (await change(row, { ...request, basedOn })).changes;
  };
  if (labels.name !== recording.name) await save({ action: Action.RENAME, name: labels.name });
  if (labels.note !== recording.note) await save({ action: Action.NOTE, note: labels.note });
  if (labels.tags.join() !== recording.tags.join()) await save({ action: Action.TAG, tags: [...labels.tags] });
}

export async function deleteRecording(row: Row, reason: string): Promise<void> {
  await change(row, { action: Action.DELETE, basedOn: row.recording.changes, reason });
}
