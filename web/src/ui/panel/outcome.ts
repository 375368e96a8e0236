// The outcome of what a panel's buttons request.

import { useState } from "preact/hooks";
import { reasonOf } from "../../mesh/console/connection";
import type { Notice } from "../../mesh/control/control";

/** Return the outcome of the newest action, and a function that performs one.
 *
 * @param refusal Makes the message of a refusal from its reason. */
export function useOutcome(refusal = (text: string) => text) {
  const [notice, setNotice] = useState<Notice | null>(null);
  const [isBusy, setBusy] = useState(false);
  /** @param busy Message while the work runs, such as "Saving…"; "": none.
   * @param work Returns what was done in words; nothing: no message is needed.
   * @returns Whether it succeeded. */
  const perform = async (busy: string, work: () => Promise<string | undefined>): Promise<boolean> => {
    setNotice(busy ? { kind: "busy", text: busy } : null);
    setBusy(true);
    try {
      const done = await work();
      setNotice(done ? { kind: "done", text: done } : null);
      return true;
    } catch (error) {
      setNotice({ kind: "refused", text: refusal(reasonOf(error)) });
      return false;
    } finally {
      setBusy(false);
    }
  };
  return { notice, setNotice, isBusy, perform };
}
