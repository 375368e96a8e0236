"""A hand on a page: presses by mouse, touch and pen that Chromium takes for those of a device."""

from playwright.sync_api import Locator, Page

MOUSE, TOUCH, PEN = "mouse", "touch", "pen"
MAIN, SECOND = 1, 2  # bits of buttons
# Scripts that interrupt a hand; UNCOVER removes both. COVER takes the box of a button.
SHOW_DIALOG = "document.body.appendChild(document.createElement('dialog')).showModal()"
COVER = """(box) => { const cover = document.createElement("div"); cover.id = "cover";
  cover.style = `position:fixed;left:${box.x}px;top:${box.y}px;width:60px;height:60px;z-index:99`;
  document.body.append(cover); }"""
UNCOVER = "document.querySelectorAll('#cover, body > dialog').forEach((each) => each.remove())"


def centre_of(element: Locator) -> tuple[float, float]:
    box = element.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


class Hand:
    """One pointer of a kind; coordinates in px of the viewport."""

    def __init__(self, page: Page, kind: str) -> None:
        self._kind, self._at, self._buttons = kind, (0.0, 0.0), 0
        self._page = page.context.new_cdp_session(page)

    def press(self, x: float, y: float) -> None:
        self._at = x, y
        if self._kind == TOUCH:
            self._buttons = MAIN
            self._touch("touchStart")
        else:
            self._buttons = 0
            self._mouse("mouseMoved")
            self._buttons = MAIN
            self._mouse("mousePressed", "left")

    def move(self, x: float, y: float) -> None:
        self._at = x, y
        self._touch("touchMove") if self._kind == TOUCH else self._mouse("mouseMoved")

    def lift(self) -> None:
        if self._kind == TOUCH:
            self._end_touch("touchEnd")
        else:
            for button, bit in (("right", SECOND), ("left", MAIN)):
                if self._buttons & bit:
                    self._buttons &= ~bit
                    self._mouse("mouseReleased", button)

    def press_another(self, x: float, y: float) -> None:
        """Add a second finger, or press the second button."""
        if self._kind == TOUCH:
            self._touch("touchStart", (x, y))
        else:
            self._buttons |= SECOND
            self._mouse("mousePressed", "right")

    def cancel(self) -> None:
        """End the touch as a gesture of the system does."""
        self._end_touch("touchCancel")

    def focus_is_real(self, real: bool) -> None:
        """Let another window take the page's focus, or pretend that the page always has it."""
        self._page.send("Emulation.setFocusEmulationEnabled", {"enabled": not real})

    def _touch(self, kind: str, *others: tuple[float, float]) -> None:
        points = [{"x": x, "y": y, "id": number} for number, (x, y) in enumerate((self._at, *others))]
        self._page.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    def _end_touch(self, kind: str) -> None:
        if self._buttons:
            self._buttons = 0
            self._page.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": []})

    def _mouse(self, kind: str, button: str = "none") -> None:
        x, y = self._at
        if kind == "mouseMoved" and self._buttons:
            button = "left"  # without it Chromium drops the capture
        pressed = {"button": button, "buttons": self._buttons, "clickCount": int(kind != "mouseMoved")}
        self._page.send(
            "Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, **pressed, "pointerType": self._kind}
        )
