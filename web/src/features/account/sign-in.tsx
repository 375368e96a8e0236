// The sign-in page: the console's name, how the page reaches it, name and password.

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { reasonText, withValue } from "../../i18n/reasons";
import { accountText as a, switchLanguage, t, textIn } from "../../i18n/texts";
import { endedBy, me, signIn } from "../../mesh/console/account";
import { RefusedRequest } from "../../mesh/console/refusal";
import { Button } from "../../ui/inputs/button";
import { PasswordField } from "../../ui/inputs/password-field";
import { submit } from "../../ui/inputs/submit";
import { TextInput } from "../../ui/inputs/text-input";
import { switchTheme, theme } from "../../ui/page/theme";
import "../../panels/account-form.css";
import "./sign-in.css";

export function SignIn() {
  const [name, setName] = useState("");
  const [password, setPassword] = useState("");
  const [problem, setProblem] = useState<RefusedRequest | null>(null);
  const [busy, setBusy] = useState(false);
  const [waitUntil, setWaitUntil] = useState(0);
  const left = useSecondsUntil(waitUntil);
  const input = useRef<HTMLInputElement>(null);
  useLayoutEffect(() => input.current?.focus(), []);
  const how = me.value;
  const send = async () => {
    if (busy || left > 0) return;
    setBusy(true);
    setProblem(null);
    try {
      await signIn(name, password);
    } catch (error) {
      const refused = error instanceof RefusedRequest ? error : new RefusedRequest(0, a("unreachable"));
      setProblem(refused);
      if (refused.reason?.code === "account.wait") setWaitUntil(Date.now() + Number(refused.reply.seconds) * 1000);
      if (refused.reason?.code === "account.wrong") setPassword("");
    }
    setBusy(false);
  };
  return (
    <section class="sign-in stack grow" aria-label={a("sign_in")}>
      {/* For narrow screens, where the bar has no space for them. */}
      <p class="sign-in-look to-end gap-8">
        <Button quiet text={t("language")} onClick={() => switchLanguage()} title={t("language_hint")} />
        <Button quiet text={t(theme.value === "dark" ? "theme_light" : "theme_dark")} onClick={switchTheme} />
      </p>
      <form onSubmit={submit(() => void send())}>
        <h1>{how ? a("to_site", { site: how.site }) : "\u00a0"}</h1>
        {endedBy.value && (
          <div class={`sign-in-ended ${endedBy.value === "signed_out" ? "" : "warning"}`} role="status">
            <p>{textIn("account", `out_${endedBy.value}`) ?? a("out_signed_out")}</p>
            {endedBy.value !== "signed_out" && <p class="dim">{a("out_nothing_live")}</p>}
          </div>
        )}
        <label>
          <span>{a("name")}</span>
          <TextInput
            ref={input}
            name="username"
            autocomplete="username"
            autocapitalize="none"
            autocorrect="off"
            maxLength={32}
            required
            value={name}
            set={setName}
          />
        </label>
        <PasswordField label={a("password")} kind="current-password" value={password} set={setPassword} />
        <p class="sign-in-problem" role="alert">
          {problem && (!waitUntil || left > 0) && a("not_signed_in", { text: textOf(problem, left) })}
        </p>
        <Button primary text={a(busy ? "signing_in" : "sign_in")} type="submit" disabled={busy || left > 0} />
        <p class="dim">{a("forgotten")}</p>
      </form>
      <footer>
        <p class={how?.insecure ? "state warning" : "dim"}>
          <span class={`shape ${how?.insecure ? "warning" : ""}`} aria-hidden="true" />
          {how && a(how.insecure && !how.secure ? "insecure" : how.secure ? "secure" : "this_machine")}
        </p>
        <p class="dim">{a("no_stop")}</p>
      </footer>
    </section>
  );
}

/** Return the reason in words, with the seconds that are left to wait. */
function textOf({ reason, message }: RefusedRequest, left: number): string {
  if (!reason || left === 0) return message;
  return reasonText(withValue(reason, "seconds", String(left)), message);
}

/** Return the whole seconds until a time, counted down. */
function useSecondsUntil(time: number): number {
  const secondsLeft = () => Math.max(0, Math.ceil((time - Date.now()) / 1000));
  const [left, setLeft] = useState(secondsLeft);
  useEffect(() => {
    setLeft(secondsLeft());
    const timer = setInterval(() => setLeft(secondsLeft()), 250);
    return () => clearInterval(timer);
  }, [time]);
  return left;
}
