// The 3-D panel of Define, with a scene that only notes what it is asked.

import { beforeEach, expect, test, vi } from "vitest";
import { pass, type } from "../../../hands";
import { field, go, newDefine } from "../server";

const view = { touched: false, look: vi.fn(), now: vi.fn(), turn: vi.fn() };

beforeEach(async () => {
  vi.doMock("../../../../src/features/define/scene/define-scene", () => ({
    DefineScene: class {
      view = view;
      show() {}
      setColours() {}
      showRows() {}
      showShapes() {}
      drag() {}
      dispose() {}
    },
  }));
  await newDefine();
  view.touched = false;
  view.look.mockReset();
  return () => vi.doUnmock("../../../../src/features/define/scene/define-scene");
});

test("the camera keeps an arm that grows in the picture, until the user moves it", async () => {
  await go("pt500");
  const far = () => view.look.mock.lastCall?.[0].eye.length();
  const before = far();
  type(field("joint/1/a"), "5000");
  await pass();
  expect(far()).toBeGreaterThan(2 * before);
  view.touched = true;
  view.look.mockReset();
  type(field("joint/1/a"), "50");
  await pass();
  expect(view.look).not.toHaveBeenCalled();
});
