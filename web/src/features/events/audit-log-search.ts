// Older entries of the gateways' audit logs, requested from some gateways at a time.

import { timestampFromMs } from "@bufbuild/protobuf/wkt";
import { AuditListSchema, AuditQuerySchema } from "../../gen/robomesh_pb";
import { ask, reasonOf } from "../../mesh/console/connection";
import type { AuditLine } from "./entries";
import { auditLines } from "./entries";

export const MAX_ROBOTS = 40;
const AT_ONCE = 6;
const TIMEOUT_S = 10;
const MOST_OF_ONE = 1000;

export interface Found {
  entries: AuditLine[];
  failed: { robot: string; text: string }[];
}

/** Request entries of the last `sinceS` seconds; infinite: all. */
export async function searchAuditLogs(robotKeys: readonly string[], sinceS: number): Promise<Found> {
  const found: Found = { entries: [], failed: [] };
  const left = [...robotKeys];
  const since = Number.isFinite(sinceS) ? { since: timestampFromMs(Date.now() - sinceS * 1000) } : {};
  const next = async (): Promise<void> => {
    for (let key = left.shift(); key; key = left.shift()) {
      const [, site = "", robot = ""] = key.split("/");
      try {
        const query = { most: MOST_OF_ONE, ...since };
        const { entries } = await ask(`${key}/audit/find`, AuditQuerySchema, query, AuditListSchema, TIMEOUT_S);
        found.entries.push(...auditLines(site, robot, entries));
      } catch (error) {
        found.failed.push({ robot: `${site}/${robot}`, text: reasonOf(error) });
      }
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, next));
  return found;
}
