"""How far the tool moves after a jog should have ended: the overrun, and the speed while the button is held.

A site runs as real processes (router, gateway, simulated controller, kinematics, console), and the Robot page
in a real Chromium, whose pointer holds a button of the Tool panel. The moment of the end and the joint states
have the clock of this machine; the tool's path follows from the recorded joint states by forward kinematics.

    release   the pointer is released
    frozen    a loop blocks the page's main thread
    paused    SIGSTOP of the browser's renderer process
    killed    SIGKILL of the browser with all its processes
    cut       a proxy between browser and console forwards nothing more, and closes nothing

    ./dev run python benchmarks/jog.py [--only release,frozen,paused,killed,cut] [--runs 5]
                                       [--speed slow,medium,fast] [--json]

Bound: 150 ms at the jog's speed, the controller's braking, and the delays of page, console and gateway; never
more than 10 mm beyond the position at which the gateway sent its last part.
"""

import argparse
import contextlib
import json
import os
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import psutil
from playwright.sync_api import Browser, Page, sync_playwright

if __name__ == "__main__":
    # Import from the root: a program in this folder has the same name as a package.
    sys.path[0] = str(Path(__file__).parents[1])

import robomesh
from benchmarks.latency import service, until_connectable
from robots.description import load
from robots.model import build_model, tool_placement
from tests.browser.conftest import ARGUMENTS, CHROMIUM, NO_WEBGL
from tests.browser.robot_page import take
from tests.conftest import free_port
from web import build_page

ENDS = ("release", "frozen", "paused", "killed", "cut")
SPEEDS = {"slow": "10", "medium": "50", "fast": "250"}
MODEL = "pt600"
START_DEG = [-40.0, 90.0, -90.0, 10.0, 0.0]
# Along y of the base there is room for half a metre.
BUTTON = "Base Y +"
HOLD_S = 0.8
REST_S = 1.5
BLOCK = """(ms) => { setTimeout(() => {
  window.blockedAt = Date.now();
  while (Date.now() < window.blockedAt + ms);
}, 0); }"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", default=",".join(ENDS))
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--speed", default="fast")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    ends, speeds = options.only.split(","), options.speed.split(",")
    if unknown := [each for each in ends if each not in ENDS] + [
        each for each in speeds if each not in SPEEDS
    ]:
        parser.error(f"unknown: {', '.join(unknown)}")
    build_page.build()
    found: dict[str, Any] = {"load": os.getloadavg()[0], "runs": options.runs, "speeds": {}}
    with (
        tempfile.TemporaryDirectory() as folder,
        running_services(Path(folder)) as (router, console),
        Proxy(console) as proxy,
        robomesh.connect(router, timeout_s=20.0) as mesh,
        Bench(mesh, proxy, options.runs) as bench,
    ):
        for speed in speeds:
            rows = found["speeds"][speed] = {}
            for end in ends:
                rows[end] = bench.measure(end, speed)
                if not options.json:
                    print(f"{speed:7}{end:9}{text_of(rows[end])}", flush=True)
    if options.json:
        print(json.dumps(found))


@contextlib.contextmanager
def running_services(folder: Path) -> Iterator[tuple[str, str]]:
    """Run the services that a jog needs; yield the router's and the console's addresses."""
    router, controller, console = (free_port() for _ in range(3))
    endpoint = f"tcp/127.0.0.1:{router}"
    site = folder / "site.toml"
    site.write_text(
        f'site = "test"\n[router]\nlisten = ["{endpoint}"]\n[audit]\nfolder = "{folder}/audit"\n'
        f'[console]\nlisten = "127.0.0.1:{console}"\n[[robot]]\nname = "arm"\nmodel = "{MODEL}"\n'
        f'controller = "tcp://127.0.0.1:{controller}"\nstop_proven = true\n'
    )
    program = [sys.executable, "-m", "services.command_line.main", "simulate", "--robot", MODEL]
    simulator = subprocess.Popen(
        [*program, "--listen", f"127.0.0.1:{controller}"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        with contextlib.ExitStack() as stack:
            stack.enter_context(service("router", site, endpoint))
            until_connectable(router)
            until_connectable(controller)
            for role in ("gateway", "kinematics", "console"):
                stack.enter_context(service(role, site, endpoint))
            until_connectable(console)
            yield endpoint, f"http://127.0.0.1:{console}/"
    finally:
        simulator.terminate()
        simulator.wait(10)


def text_of(row: dict[str, Any]) -> str:
    """Return a row for people."""
    overruns = " ".join(f"{each:.1f}" for each in row["overruns_mm"])
    why = ", ".join(sorted(set(row["why"])))
    return (
        f"overrun {row['median_mm']:5.1f} mm ({overruns}), at {row['speed_mm_s']:.0f} mm/s"
        f" (5 to 95 %: {row['slowest_mm_s']:.0f} to {row['fastest_mm_s']:.0f}); {why}"
    )


class Proxy:
    """A TCP proxy to the console, which can stop forwarding."""

    def __init__(self, console: str) -> None:
        host, _, port = console.removeprefix("http://").rstrip("/").partition(":")
        self._to = host, int(port)
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"http://127.0.0.1:{self._listener.getsockname()[1]}/"
        self.cut = False
        self._sockets: list[socket.socket] = []

    def __enter__(self) -> "Proxy":
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.close()
        for each in self._sockets:
            each.close()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                far = socket.create_connection(self._to)
                for each in (near, far):
                    each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._sockets += [near, far]
                for one, other in ((near, far), (far, near)):
                    threading.Thread(target=self._forward, args=(one, other), daemon=True).start()

    def _forward(self, one: socket.socket, other: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := one.recv(65536):
                if not self.cut:
                    other.sendall(data)
            other.shutdown(socket.SHUT_WR)


@dataclass
class States:
    """Joint states with the gateway's times, as they arrive."""

    times_s: list[float] = field(default_factory=list)
    positions: list[tuple[float, ...]] = field(default_factory=list)

    def collect(self, robot: robomesh.Robot) -> None:
        for state in robot.joints(buffer=1000, on_stale="yield"):
            self.times_s.append(state.time.timestamp())
            self.positions.append(state.positions)


class Bench:
    """The page of a robot, and its joint states."""

    def __init__(self, mesh: robomesh.Mesh, proxy: Proxy, runs: int) -> None:
        self._robot, self._proxy, self._runs = mesh.robot("arm"), proxy, runs
        self._model = build_model(load(MODEL))
        self._states = States()
        self._stack = contextlib.ExitStack()
        self._browser: Browser | None = None
        self._page: Page | None = None

    def __enter__(self) -> "Bench":
        self._playwright = self._stack.enter_context(sync_playwright())
        threading.Thread(target=self._states.collect, args=(self._robot,), daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def measure(self, end: str, speed: str) -> dict[str, Any]:
        """Return the overruns of some runs, and the speeds before the end."""
        overruns, speeds, whys = [], [], []
        tries = 0
        while len(overruns) < self._runs and tries < 4 * self._runs:
            tries += 1
            found = self._run(end, speed)
            if found is None:
                print(f"ended before: {self._why()}", file=sys.stderr)
                continue
            overrun, profile, why = found
            overruns.append(overrun)
            speeds.append(profile)
            whys.append(why)
        if not overruns:
            raise SystemExit(f"{end}: every jog ended by itself: the machine is too busy")
        together = np.concatenate(speeds)
        return {
            "overruns_mm": overruns,
            "median_mm": statistics.median(overruns),
            "speed_mm_s": float(np.median(together)),
            "slowest_mm_s": float(np.percentile(together, 5)),
            "fastest_mm_s": float(np.percentile(together, 95)),
            "greatest_mm_s": float(together.max()),
            "why": whys,
            "ended_before": tries - len(overruns),
        }

    def _run(self, end: str, speed: str) -> tuple[float, np.ndarray, str] | None:
        """Jog, end it, and return overrun [mm], speeds [mm/s] and the reason; None: it ended before."""
        self._to_start()
        page = self._in_control(speed)
        button = page.get_by_role("button", name=BUTTON, exact=True)
        place = button.bounding_box()
        assert place is not None
        page.mouse.move(place["x"] + place["width"] / 2, place["y"] + place["height"] / 2)
        pressed_s = time.time()
        page.mouse.down()
        time.sleep(HOLD_S)
        ended_s = self._end(end, page)
        time.sleep(REST_S)
        with contextlib.suppress(Exception):
            if end not in ("killed", "paused"):
                page.mouse.up()
        times, path = self._tool_path(pressed_s)
        why = self._why()
        self._recover(end, page)
        moving = np.linalg.norm(np.diff(path, axis=0), axis=1) / np.maximum(np.diff(times), 1e-6)
        at_end = moving[max(int(np.searchsorted(times, ended_s)) - 12, 0) :][:10]
        if not len(at_end) or at_end.mean() < 1e-3:
            return None  # on a busy machine a keep-alive was late
        after = path[times >= ended_s - 0.005]
        overrun = float(np.linalg.norm(np.diff(after, axis=0), axis=1).sum()) * 1000
        begun = times[1:][moving > 1e-3]
        steady = (times[1:] > begun[0] + 0.25) & (times[1:] < ended_s) if len(begun) else np.zeros(0, bool)
        return overrun, self._smoothed(times, path)[steady] * 1000, why

    @staticmethod
    def _smoothed(times: np.ndarray, path: np.ndarray) -> np.ndarray:
        """Return the tool's speed over 50 ms before each sample but the first [m/s]."""
        way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        before = np.interp(times - 0.05, times, way)
        speeds: np.ndarray = ((way - before) / 0.05)[1:]
        return speeds

    def _tool_path(self, since_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Return times (m,) and tool positions (m, 3) [m] since a time."""
        count = len(self._states.positions)
        times = np.array(self._states.times_s[:count])
        chosen = times >= since_s - 0.1
        positions = [
            each for each, is_in in zip(self._states.positions[:count], chosen, strict=True) if is_in
        ]
        return times[chosen], np.array(
            [tool_placement(self._model, np.array(each))[:3, 3] for each in positions]
        )

    def _why(self) -> str:
        """Return the gateway's reason for the end of the newest jog."""
        last = self._robot.last("events")
        events = [] if last is None else last.message.events
        for event in reversed(events):
            if event.code == "jog.ended":
                return str(event.reason.causes[0].text)
        return "not ended"

    def _end(self, end: str, page: Page) -> float:
        """End the hold; return when, on this machine's clock."""
        if end == "release":
            at = time.time()
            page.mouse.up()
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
            self._browser = self._page = None

    def _processes(self) -> list[psutil.Process]:
        """Return the browser's processes, the first one first: they are children of Playwright's driver."""
        mine = psutil.Process().children(recursive=True)
        return [each for each in mine if "chromium" in " ".join(each.cmdline()[:1])]

    def _renderers(self) -> list[psutil.Process]:
        return [each for each in self._processes() if "--type=renderer" in each.cmdline()]

    def _to_start(self) -> None:
        """Put the arm at the start, without a latched stop."""
        with self._robot.control("bench", take="next run") as arm:
            state = self._robot.last("controller")
            if state is not None and state.message.HasField("stop"):
                arm.reset()
            arm.speed(100)
            if state is None or state.message.homed != state.message.YES:
                arm.home()
            arm.move_joints_deg(START_DEG)

    def _in_control(self, speed: str) -> Page:
        """Return the page, in control, with the panel set to hold."""
        if self._page is None:
            self._browser = self._playwright.chromium.launch(
                executable_path=CHROMIUM, args=ARGUMENTS, handle_sigint=False
            )
            self._page = self._browser.new_page(viewport={"width": 1440, "height": 900})
            # Drawing 3-D by the processor would block the page for longer than a keep-alive.
            self._page.add_init_script(NO_WEBGL)
            self._page.goto(f"{self._proxy.address}#/test/arm")
        page = self._page
        take(page, "bench", slow=False)
        panel = page.locator(".panel.tool")
        for name in ("Base", "Jog", SPEEDS[speed]):
            panel.get_by_role("button", name=name, exact=True).click()
        panel.get_by_role("button", name=BUTTON, exact=True).scroll_into_view_if_needed()
        time.sleep(1.0)  # a control that has just moved ignores presses
        return page


if __name__ == "__main__":
    main()
