"""How far the tool moves after a jog should have ended: the overrun, and the speed while the button is held.

A site runs as real processes (router, gateway, simulated controller, kinematics, console), and the Robot page
in a real Chromium, whose pointer holds a button of the Tool panel: a mouse, or what `--hands` names, by
Chromium's input events. A proxy between gateway and controller logs each unit and when it passed, by this
machine's clock, as that of the end. The tool's path follows from the logged positions by forward kinematics.

    release   the pointer is released            other     a second finger, or the second button
    left      it moves 16 px outside of it       cancel    a gesture of the system ends a touch (touch only)
    blur      another window comes to the front  dialog    a dialog opens
    covered   something is before the button     wheel     the page scrolls the button away (mouse only)
    scroll    the finger moves before it rested: nothing may move (touch and pen)
    taps      20 quick taps of Step 5° of a joint: degrees, not mm, after the last tap
    frozen    a loop blocks the page's main thread
    paused    SIGSTOP of the browser's renderer process
    killed    SIGKILL of the browser with all its processes
    cut       a proxy between browser and console forwards nothing more, and closes nothing

    ./dev run python -m benchmarks jog [--only release,frozen,paused,killed,cut] [--hands mouse,touch,pen]
                                       [--runs 5] [--speed slow,medium,fast] [--json]

Bound: 150 ms at the jog's speed, the controller's braking, and the delays of page, console and gateway; never
more than 10 mm beyond the position at which the gateway sent its last part. Taps: two steps.
"""

import contextlib
import re
import signal
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import psutil
from playwright.sync_api import Browser, Page, sync_playwright

import robomesh
from benchmarks.harness.processes import program, until_connectable
from benchmarks.harness.program import ROOT, chosen, say
from benchmarks.harness.sites import ROBOMESH, robot, running_site
from benchmarks.harness.tables import word
from benchmarks.page.browser import NO_WEBGL
from benchmarks.page.jog_wire import Proxy, UnitLog, rest_ms, until_rest
from robots.descriptions.description import load
from robots.kinematics.model import build_model, tool_placement
from tests.browser.conftest import ARGUMENTS, CHROMIUM
from tests.browser.hand import COVER, MOUSE, PEN, SHOW_DIALOG, TOUCH, UNCOVER, Hand
from tests.browser.robot_page import take
from tests.ports import free_port
from web import build_page

BY_HAND = ("release", "left", "other", "cancel", "blur", "dialog", "covered", "wheel", "scroll", "taps")
ENDS = ("release", "frozen", "paused", "killed", "cut")
ONLY_BY = {"cancel": ("touch",), "wheel": ("mouse",), "scroll": ("touch", "pen")}
SPEEDS = {"slow": "10", "medium": "50", "fast": "250"}
MODEL = "pt600"
START_DEG = [-40.0, 90.0, -90.0, 10.0, 0.0]
# Along y of the base there is room for half a metre.
BUTTON = "Base Y +"
HOLD_S = 0.8
REST_S = 1.5
TAPPED, TAPS, TAP_EACH_S = "waist +5°", 20, 0.05
BLOCK = """(ms) => { setTimeout(() => {
  window.blockedAt = Date.now();
  while (Date.now() < window.blockedAt + ms);
}, 0); }"""


def measure(
    only: str = ",".join(ENDS), hands: str = "mouse", runs: int = 5, speed: str = "fast"
) -> dict[str, Any]:
    ends, kinds = chosen("--only", only, (*BY_HAND, *ENDS)), chosen("--hands", hands, (MOUSE, TOUCH, PEN))
    build_page.build()
    found: dict[str, Any] = {"runs": runs, "speeds": {}}
    with (
        UnitLog() as log,
        running_services(log) as (router, console),
        Proxy(console) as proxy,
        robomesh.connect(router, timeout_s=20.0) as mesh,
        Bench(mesh, proxy, log, runs) as bench,
    ):
        for name in chosen("--speed", speed, SPEEDS):
            rows = found["speeds"][name] = {}
            for end, hand in product(ends, kinds):
                if hand not in ONLY_BY.get(end, kinds if end in BY_HAND else kinds[:1]):
                    continue
                row = rows[f"{end} {hand}"] = bench.measure(end, name, hand)
                say(f"{name} {end} {hand}: {word(row['overruns'])} {row['unit']}")
    return found


@contextlib.contextmanager
def running_services(log: UnitLog) -> Iterator[tuple[str, str]]:
    """Run the services that a jog needs; yield the router's and the console's addresses."""
    controller, port = free_port(), int(log.address.rpartition(":")[2])
    log.forward_to("127.0.0.1", controller)
    simulate = ("simulate", "--robot", MODEL, "--listen", f"127.0.0.1:{controller}")
    with program(*ROBOMESH, *simulate, cwd=ROOT):
        until_connectable(controller)
        services = ("gateway", "kinematics", "console")
        with running_site(*services, tables=robot("arm", port), name="test") as site:
            until_rest(log)  # the gateway is connected
            yield site.endpoint, f"http://{site.console}/"


@dataclass(frozen=True)
class Run:
    """What the controller's log says of one hold.

    Attributes:
        overrun: Way after the end [mm], or [degrees] of taps.
        rest_ms: From the end to the last motion.
        speeds: Of the tool before the end [mm/s].
        why: The page's sentence.
    """

    overrun: float
    rest_ms: float
    speeds: np.ndarray
    why: str


class Bench:
    """The page of a robot, and its joint states."""

    def __init__(self, mesh: robomesh.Mesh, proxy: Proxy, log: UnitLog, runs: int) -> None:
        self._robot, self._proxy, self._log, self._runs = mesh.robot("arm"), proxy, log, runs
        self._model = build_model(load(MODEL))
        self._stack = contextlib.ExitStack()
        self._browser: Browser | None = None
        self._page: Page | None = None
        self._other: Page | None = None

    def __enter__(self) -> "Bench":
        self._playwright = self._stack.enter_context(sync_playwright())
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def measure(self, end: str, speed: str, hand: str) -> dict[str, Any]:
        """Return the overruns of some runs, and the speeds before the end."""
        runs: list[Run] = []
        tries = 0
        while len(runs) < self._runs and tries < 4 * self._runs:
            tries += 1
            self._to_start()
            page = self._in_control(speed, hand)
            run = self._taps(page) if end == "taps" else self._run(end, page)
            if run is not None:
                runs.append(run)
        if not runs:
            raise SystemExit(f"{end}: every jog ended by itself: the machine is too busy")
        together = np.concatenate([run.speeds for run in runs])
        slowest, median, fastest = np.percentile(together, (5, 50, 95)) if len(together) else (0.0, 0.0, 0.0)
        return {
            "unit": "°" if end == "taps" else "mm",
            "overruns": [run.overrun for run in runs],
            "median": statistics.median(run.overrun for run in runs),
            "rest_ms": statistics.median(run.rest_ms for run in runs),
            "most_rest_ms": max(run.rest_ms for run in runs),
            "speed_mm_s": float(median),
            "slowest_mm_s": float(slowest),
            "fastest_mm_s": float(fastest),
            "why": [run.why for run in runs],
            "ended_before": tries - len(runs),
        }

    def _run(self, end: str, page: Page) -> Run | None:
        """Hold, and end it; None: it ended before, for on a busy machine a keep-alive was late."""
        box = page.get_by_role("button", name=BUTTON, exact=True).bounding_box()
        assert box is not None
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        pressed_s = time.time()
        self._hand.press(x, y)
        if end == "scroll":
            ended_s = time.time()
            for moved in range(4, 120, 4):
                self._hand.move(x, y - moved)
        else:
            time.sleep(HOLD_S)
            ended_s = self._end(end, page, box)
        time.sleep(REST_S)
        why = "nothing began" if end == "scroll" else self._why(end, page)
        with contextlib.suppress(Exception):
            if end not in ("killed", "paused"):
                self._hand.lift()
        times, positions = self._log.positions_since(pressed_s - 0.1)
        self._recover(end, page)
        path = np.array([tool_placement(self._model, each)[:3, 3] for each in positions])
        ways = np.linalg.norm(np.diff(path, axis=0), axis=1)
        moving = ways / np.maximum(np.diff(times), 1e-6)
        at_end = moving[max(int(np.searchsorted(times, ended_s)) - 12, 0) :][:10]
        by_itself = end in BY_HAND and re.search("late by|busy for|no keep-alive", why)
        if by_itself or (end != "scroll" and (not len(at_end) or at_end.mean() < 1e-3)):
            say(f"ended before: {why}")
            return None
        begun = times[1:][moving > 1e-3]
        if end == "scroll" and len(begun):
            why = "the arm moved"
        steady = (times[1:] > begun[0] + 0.25) & (times[1:] < ended_s) if len(begun) else np.zeros(0, bool)
        speeds = self._smoothed(times, path)[steady] * 1000 if len(begun) else np.zeros(0)
        return Run(
            1000 * float(ways[times[1:] > ended_s].sum()), rest_ms(times, moving > 1e-3, ended_s), speeds, why
        )

    def _taps(self, page: Page) -> Run:
        """Tap a joint's step quickly; the overrun is what the joint turns after the last tap."""
        page.locator(".panel.joints").get_by_role("button", name="5", exact=True).click()
        box = page.get_by_role("button", name=TAPPED, exact=True).bounding_box()
        assert box is not None
        time.sleep(1.0)  # a control that has just moved ignores presses
        begun_s = time.time()
        for _ in range(TAPS):
            self._hand.press(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
            self._hand.lift()
            time.sleep(TAP_EACH_S)
        ended_s = time.time()
        until_rest(self._log)
        times, positions = self._log.positions_since(begun_s - 0.1)
        turned = np.degrees(np.array(positions)[:, 0])
        taken = self._log.count(b"RELATIVE.DEG", since_s=begun_s)
        after = float(turned[-1] - np.interp(ended_s, times, turned))
        moving = np.abs(np.diff(turned)) > 1e-3
        why = f"{turned[-1] - turned[0]:.1f}° by {taken} of {TAPS} taps"
        return Run(after, rest_ms(times, moving, ended_s), np.zeros(0), why)

    @staticmethod
    def _smoothed(times: np.ndarray, path: np.ndarray) -> np.ndarray:
        """Return the tool's speed over 50 ms before each sample but the first [m/s]."""
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        before = np.interp(times - 0.05, times, way)
        speeds: np.ndarray = ((way - before) / 0.05)[1:]
        return speeds

    def _why(self, end: str, page: Page) -> str:
        """Return the page's sentence about the end; of a page that is gone or cut off, the gateway's."""
        if end not in ("killed", "paused", "cut"):
            text = page.locator(".panel.tool").get_by_label("Outcome", exact=True).inner_text()
            return text.rpartition("Ended: ")[2].rstrip(".")
        last = self._robot.last("events")
        events = [] if last is None else last.message.events
        for event in reversed(events):
            if event.code == "jog.ended":
                return str(event.reason.causes[0].text)
        return "not ended"

    def _end(self, end: str, page: Page, box: Any) -> float:
        """End the hold; return when, on this machine's clock."""
        x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        by_hand: dict[str, Callable[[], object]] = {
            "release": self._hand.lift,
            "left": lambda: self._hand.move(x, box["y"] - 16),
            "other": lambda: self._hand.press_another(x - 300, y),
            "cancel": self._hand.cancel,
            "blur": lambda: self._other and self._other.bring_to_front(),
            "dialog": lambda: page.evaluate(SHOW_DIALOG),
            "covered": lambda: page.evaluate(COVER, box),
            "wheel": lambda: page.mouse.wheel(0, 200),
        }
        if end in by_hand:
            at = time.time()
            by_hand[end]()
            return at
        if end == "frozen":
            page.evaluate(BLOCK, int(REST_S * 1000))
            return float(page.evaluate("window.blockedAt")) / 1000
        if end == "cut":
            at, self._proxy.cut = time.time(), True
            return at
        if end == "paused":
            at = time.time()
            for process in self._renderers():
                process.send_signal(signal.SIGSTOP)
            return at
        at = time.time()
        for process in self._processes():
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        return at

    def _recover(self, end: str, page: Page) -> None:
        self._proxy.cut = False
        if end == "paused":
            for process in self._renderers():
                process.send_signal(signal.SIGCONT)
        if end in ("killed", "cut", "paused"):
            with contextlib.suppress(Exception):
                assert self._browser is not None
                self._browser.close()
            self._browser = self._page = self._other = None
        else:
            page.evaluate(UNCOVER)
            page.bring_to_front()

    def _processes(self) -> list[psutil.Process]:
        """Return the browser's processes, the first one first: they are children of Playwright's driver."""
        mine = psutil.Process().children(recursive=True)
        return [each for each in mine if "chromium" in " ".join(each.cmdline()[:1])]

    def _renderers(self) -> list[psutil.Process]:
        return [each for each in self._processes() if "--type=renderer" in each.cmdline()]

    def _to_start(self) -> None:
        """Put the arm at the start, without a latched stop."""
        until_rest(self._log)
        with self._robot.control("bench", take="next run") as arm:
            state = self._robot.last("controller")
            if state is not None and state.message.HasField("stop"):
                arm.reset()
            arm.speed(100)
            if state is None or state.message.homed != state.message.YES:
                arm.home()
            arm.move_joints_deg(START_DEG)

    def _in_control(self, speed: str, hand: str) -> Page:
        """Return the page, in control, with the panel set to hold."""
        if self._page is None:
            self._browser = self._playwright.chromium.launch(
                executable_path=CHROMIUM, args=ARGUMENTS, handle_sigint=False
            )
            context = self._browser.new_context(viewport={"width": 1440, "height": 900})
            self._page, self._other = context.new_page(), context.new_page()
            # Drawing 3-D by the processor would block the page for longer than a keep-alive.
            self._page.add_init_script(NO_WEBGL)
            self._page.goto(f"{self._proxy.address}#/test/arm")
        page = self._page
        self._hand = Hand(page, hand)
        self._hand.focus_is_real(True)
        page.bring_to_front()
        page.wait_for_function("() => document.hasFocus()")
        take(page, "bench", slow=False)
        panel = page.locator(".panel.tool")
        for name in ("Base", "Jog", SPEEDS[speed]):
            panel.get_by_role("button", name=name, exact=True).click()
        panel.get_by_role("button", name=BUTTON, exact=True).scroll_into_view_if_needed()
        time.sleep(1.0)  # a control that has just moved ignores presses
        return page
