// Fields, choices and forms.

import { act } from "preact/test-utils";
import { beforeEach, expect, test, vi } from "vitest";
import { newPage } from "../../console";
import { button, find, key, press, send, submit, texts, type } from "../../hands";
import { hide, show } from "../../shown";

beforeEach(() => newPage());

test("a button has its kind", async () => {
  const { Button } = await import("../../../src/ui/inputs/button");
  const place = show(<Button text="Go" />);
  expect(button("Go").className).toBe("action");
  show(<Button text="Go" quiet primary destructive title="x" />, place);
  expect([button("Go").className, button("Go").title]).toEqual(["quiet primary destructive", "x"]);
});

test("one of several is chosen, and says so without its colour", async () => {
  const { Choice, Toggle } = await import("../../../src/ui/inputs/choice");
  const choose = vi.fn();
  show(<Choice label="View" values={["a", "b"]} chosen="a" text={(each) => each.toUpperCase()} choose={choose} />);
  expect(["A", "B"].map((text) => button(text).getAttribute("aria-pressed"))).toEqual(["true", "false"]);
  press("B");
  expect(choose.mock.calls).toEqual([["b"]]);
  const set = vi.fn();
  show(<Toggle text="Trail" on set={set} />);
  press("Trail");
  expect([set.mock.calls, button("Trail").getAttribute("aria-pressed")]).toEqual([[[false]], "true"]);
});

test("a choice in a list gives the chosen value", async () => {
  const { Select } = await import("../../../src/ui/inputs/select");
  const choose = vi.fn();
  show(<Select label="Kind" value="b" values={["a", "b"]} text={(each) => each.toUpperCase()} choose={choose} />);
  expect([find<HTMLSelectElement>("select").value, texts("option")]).toEqual(["b", ["A", "B"]]);
  find<HTMLSelectElement>("select").value = "a";
  send("select", new Event("change"));
  expect(choose.mock.calls).toEqual([["a"]]);
});

test("a field shows its hint as its name, and is neither completed nor corrected", async () => {
  const { TextInput } = await import("../../../src/ui/inputs/text-input");
  const set = vi.fn();
  const place = show(<TextInput hint="Name" value="" set={set} />);
  const field = find<HTMLInputElement>("input");
  expect([field.placeholder, field.getAttribute("aria-label"), field.autocomplete]).toEqual(["Name", "Name", "off"]);
  type("input", "x");
  expect(set.mock.calls).toEqual([["x"]]);
  show(<TextInput value="" set={set} autocomplete="username" />, place);
  expect([field.placeholder, field.autocomplete]).toEqual(["", "username"]);
});

test("a password is hidden until a person wants to see it, and Caps Lock is said", async () => {
  const { PasswordField } = await import("../../../src/ui/inputs/password-field");
  const place = show(
    <PasswordField label="Password" kind="new-password" value="x" set={() => undefined} hint="12 letters" />,
  );
  const kind = () => find<HTMLInputElement>("input").type;
  expect([kind(), button("Show").getAttribute("aria-pressed")]).toEqual(["password", "false"]);
  press("Show");
  expect([kind(), button("Hide").getAttribute("aria-pressed")]).toEqual(["text", "true"]);
  expect(place.textContent).toContain("12 letters");
  const caps = (on?: boolean) => {
    const event = new KeyboardEvent("keydown", { key: "a", bubbles: true });
    Object.defineProperty(event, "getModifierState", {
      value: on === undefined ? undefined : (name: string) => on && name === "CapsLock",
    });
    send("input", event);
    return texts("[role=status]");
  };
  expect([caps(true), caps(false), caps(true), caps()]).toEqual([["Caps Lock is on."], [], ["Caps Lock is on."], []]);
});

test("the same file can be taken twice, and no file is none", async () => {
  const { FileButton } = await import("../../../src/ui/inputs/file-button");
  const take = vi.fn();
  const place = show(<FileButton label="Open" accept=".urdf" multiple take={take} />);
  const input = find<HTMLInputElement>("input");
  const clicked = vi.spyOn(input, "click");
  press("Open");
  expect([clicked.mock.calls.length, input.accept, input.multiple]).toEqual([1, ".urdf", true]);
  const files = [new File(["x"], "a.urdf")];
  Object.defineProperty(input, "files", { get: () => files, configurable: true });
  send("input", new Event("change"));
  expect([take.mock.calls, input.value]).toEqual([[[files]], ""]);
  files.length = 0;
  send("input", new Event("change"));
  Object.defineProperty(input, "files", { get: () => null });
  send("input", new Event("change"));
  expect(take).toHaveBeenCalledOnce();
  show(<FileButton label="Open" quiet disabled take={take} />, place);
  expect([button("Open").disabled, button("Open").className]).toEqual([true, "quiet"]);
});

test("a reason's form begins in its first field, and gives the focus back", async () => {
  const { ReasonForm } = await import("../../../src/ui/inputs/reason-form");
  const opener = document.body.appendChild(document.createElement("button"));
  const form = { title: "Why", text: "Because", does: "Do", close: vi.fn(), done: vi.fn() };
  opener.focus();
  const place = show(<ReasonForm {...form} />);
  expect(document.activeElement).toBe(find(".reason input"));
  key(".reason input", "a");
  expect(form.close).not.toHaveBeenCalled();
  key(".reason input", "Escape");
  expect(form.close).toHaveBeenCalledOnce();
  hide(place);
  expect(document.activeElement).toBe(opener);
  show(
    <ReasonForm {...form} incomplete={false}>
      <input type="checkbox" />
    </ReasonForm>,
  );
  expect(document.activeElement).toBe(find("[type=checkbox]"));
  submit();
  expect(form.done.mock.calls).toEqual([[""]]);
  act(() => opener.remove());
});
