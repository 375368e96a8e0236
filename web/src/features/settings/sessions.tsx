// Signed-in browsers: the account's own, an administrator's view of all; each can be signed out.

import { useEffect, useState } from "preact/hooks";
import { timeText } from "../../i18n/format";
import { settingsText as s } from "../../i18n/texts";
import { post } from "../../mesh/console/account";
import { Button } from "../../ui/inputs/button";
import { NoticeLine } from "../../ui/panel/notice-line";
import { useOutcome } from "../../ui/panel/outcome";
import { Panel } from "../../ui/panel/panel";

const REFRESH_INTERVAL_MS = 5000;

interface Session {
  id: string;
  account: string;
  address: string;
  agent: string;
  began: string;
  resting: boolean;
  this: boolean;
}

export function Sessions() {
  const [sessions, setSessions] = useState<readonly Session[]>([]);
  const { notice, perform } = useOutcome((text) => s("not_done", { text }));
  const fetchSessions = async () => {
    const answer = await fetch("/account/sessions", { cache: "no-store" });
    if (answer.ok) setSessions(((await answer.json()) as { sessions: Session[] }).sessions);
  };
  useEffect(() => {
    const refresh = () => void fetchSessions().catch(() => undefined); // the page shows separately that the console is gone
    refresh();
    const timer = setInterval(refresh, REFRESH_INTERVAL_MS);
    return () => clearInterval(timer);
  }, []);
  const end = ({ id }: Session) =>
    perform("", async () => {
      await post("sessions", { end: id });
      await fetchSessions();
      return s("done");
    });
  return (
    <Panel name="sessions" title={s("sessions")}>
      <p class="footnote dim">{s("sessions_words")}</p>
      <ul class="pad-0-16-12">
        {sessions.map((session) => (
          <li key={session.id} class="row wrap tall-32 gap-0-16">
            <strong>{session.account}</strong>
            <span>{session.address}</span>
            <span class="dim" title={session.agent}>
              {`${s("began")} ${timeText(Date.parse(session.began))}`}
            </span>
            {session.resting && <span class="dim">{s("session_resting")}</span>}
            {session.this ? (
              <span class="tag">{s("session_this")}</span>
            ) : (
              <Button
                quiet
                text={s("end_session")}
                aria-label={s("end_session_of", { account: session.account, address: session.address })}
                onClick={() => void end(session)}
              />
            )}
          </li>
        ))}
      </ul>
      {notice && <NoticeLine notice={notice} />}
    </Panel>
  );
}
