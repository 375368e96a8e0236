"""Twenty values at 100 Hz for an hour in the plots of the Robot page: heap and processor time.

A site runs as real processes. The page's clocks run `--factor` times faster than the machine's, and the
page's own WebSocket handler receives as many more joint states of 20 joints: `accelerated` is an hour of
them. `real` is the same at the clocks' speed, with the moving arm's own 10 joint values at 100 Hz and the
tool's, distances and figures of the controller. `uplot` draws the same numbers as uPlot's streaming example
does, with its newest 60 s in arrays that are shifted, without protobuf or WebSocket.
The heap is measured after garbage collection.

    ./dev run python -m benchmarks plots [--only accelerated,real,uplot] [--factor 20] [--hours 1]
                                         [--minutes 5] [--json]

Target: no growth after the first minute of data.
"""

import base64
import math
import time
from typing import Annotated, Any

import numpy as np
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from playwright.sync_api import Browser, Page
from typer import Option

from benchmarks.harness.program import chosen
from benchmarks.page.browser import NO_WEBGL, PATIENCE_MS, chromium, site_for_page
from robomesh.schemas.robomesh_pb2 import ToPage
from web import build_page

JOINTS = ("waist", "shoulder", "elbow", "wrist", "roll")
TOOL = ("x", "y", "z", "roll", "pitch", "yaw", "speed")
ARM_FIELDS = [
    *(f"joints/{joint}/{number}" for joint in JOINTS for number in ("position", "velocity")),
    *(f"kinematics/tool/{number}" for number in TOOL),
    *("kinematics/manipulability", "kinematics/own_clearance", "controller/rate_hz"),
]
PARTS = ("accelerated", "real", "uplot")
ROBOT = '[[robot]]\nname = "moving"\nmodel = "pt600"\ndemo = true\n'
VALUES, RATE_HZ = 20, 100
STARTED_S = 10.0
LOOKS = 10
FRAMES = 500
MARK = bytes(range(100, 124))
UPLOT = build_page.MODULES / "uplot" / "dist" / "uPlot.iife.min.js"

FAST = """
(factor) => {
  const now = performance.now.bind(performance), began = Date.now();
  performance.now = () => now() * factor;
  Date.now = () => Math.round(began + now() * factor);
  const Socket = window.WebSocket;
  window.WebSocket = class extends Socket {
    constructor(...given) { super(...given); window.socket = this; }
  };
}
"""
# Frames are patched in place with the next sequence number and time.
FEED = """
([frames, mark, rate, factor]) => {
  const made = frames.map((text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)));
  const views = made.map((bytes) => new DataView(bytes.buffer));
  window.fed = 0;
  let at = Date.now();
  setInterval(() => {
    const begun = performance.now();
    // At most half of the time, so that the page can draw.
    for (const end = Date.now(); at < end && (performance.now() - begun) / factor < 5; at += 1000 / rate) {
      const i = window.fed++ % made.length;
      views[i].setBigUint64(mark + 8, BigInt(window.fed), true);
      views[i].setBigInt64(mark + 16, BigInt(Math.round(at * 1e6)), true);
      window.socket?.onmessage?.({ data: made[i].slice().buffer });
    }
  }, 10);
}
"""
STREAM = """
([values, rate, factor]) => {
  const now = performance.now.bind(performance);
  const data = Array.from({ length: values + 1 }, () => []);
  const line = { stroke: "red", points: { show: false } };
  const series = [{}, ...Array.from({ length: values }, () => line)];
  const place = document.body.appendChild(document.createElement("div"));
  const options = { width: 500, height: 200, scales: { x: { time: false } }, series };
  const plot = new uPlot(options, data, place);
  window.fed = 0;
  const began = now();
  setInterval(() => {
    for (const end = ((now() - began) / 1000) * factor * rate; window.fed < end; window.fed++) {
      data[0].push(window.fed / rate);
      for (let i = 1; i <= values; i++) data[i].push(Math.sin(window.fed / rate + i));
      if (data[0].length > 60 * rate) for (const column of data) column.shift();
    }
  }, 10);
  setInterval(() => plot.setData(data), 200);
}
"""


def measure(
    only: str = ",".join(PARTS),
    factor: float = 20.0,
    hours: Annotated[float, Option(help="of accelerated and uplot")] = 1.0,
    minutes: Annotated[float, Option(help="of real")] = 5.0,
) -> dict[str, Any]:
    """Run the wanted parts, each in a new browser."""
    result, fast_s = dict[str, Any](), hours * 3600 / factor
    with site_for_page(ROBOT) as site:
        time.sleep(STARTED_S)
        address = f"{site.console}#/test/moving"
        for part in chosen("--only", only, PARTS):
            with chromium() as browser:
                if part == "accelerated":
                    result[part] = accelerated(browser, address, factor, fast_s)
                elif part == "real":
                    result[part] = real(browser, address, minutes * 60)
                else:
                    result[part] = uplot(browser, factor, fast_s)
    return result


def accelerated(browser: Browser, address: str, factor: float, seconds: float) -> dict[str, Any]:
    """Feed the page with joint states of 20 joints, faster than in real time."""
    page = opened(browser, address, [f"joints/j{i + 1:02d}/position" for i in range(VALUES)], factor)
    page.evaluate(FEED, [*frames(), RATE_HZ, factor])
    return heap(page, seconds, factor)


def real(browser: Browser, address: str, seconds: float) -> dict[str, Any]:
    """Plot 20 values of the moving arm."""
    page = opened(browser, address, ARM_FIELDS, 1.0)
    return heap(page, seconds, 1.0)


def uplot(browser: Browser, factor: float, seconds: float) -> dict[str, Any]:
    """Stream the same number of values into uPlot alone."""
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.add_script_tag(path=UPLOT)
    page.evaluate(STREAM, [VALUES, RATE_HZ, factor])
    return heap(page, seconds, factor)


def frames() -> tuple[list[str], int]:
    """Return messages of a console with joint states, and where their header begins."""
    made = []
    for i in range(FRAMES):
        states = JointStates()
        for number in range(VALUES):
            position = math.sin(2 * math.pi * i / FRAMES + number)
            states.joints.add(name=f"j{number + 1:02d}", position=position, velocity=0.5)
        sample = ToPage.Sample(
            key="robomesh/test/moving/joints",
            attachment=MARK,
            payload=states.SerializeToString(),
            live=True,
        )
        made.append(ToPage(sample=sample).SerializeToString())
    (mark,) = {each.index(MARK) for each in made}
    return [base64.b64encode(each).decode() for each in made], mark


def opened(browser: Browser, address: str, fields: list[str], factor: float) -> Page:
    """Open the page with a plot of these fields, without 3-D and video."""
    page = browser.new_page(viewport={"width": 1440, "height": 900})
    page.add_init_script(NO_WEBGL)
    page.add_init_script(f"({FAST})({factor})")
    page.goto(f"{address}?plot=60,{','.join(fields)}&hide=video")
    page.wait_for_selector(".plot-card .uplot", timeout=PATIENCE_MS)
    return page


def heap(page: Page, seconds: float, factor: float) -> dict[str, Any]:
    """Measure the heap [MB] and the main thread's share while the page plots."""
    cdp = page.context.new_cdp_session(page)
    cdp.send("Performance.enable")

    def task_s() -> float:
        metrics = cdp.send("Performance.getMetrics")["metrics"]
        return float(next(each["value"] for each in metrics if each["name"] == "TaskDuration"))

    found: list[tuple[float, float]] = []
    began, busy_s = time.monotonic(), 0.0
    for _ in range(LOOKS + 1):
        cdp.send("HeapProfiler.collectGarbage")
        used = cdp.send("Runtime.getHeapUsage")
        found.append(((time.monotonic() - began) * factor / 60, used["usedSize"] / 1e6))
        before_s = task_s()
        page.wait_for_timeout(seconds / LOOKS * 1000)
        busy_s += task_s() - before_s
    later = [(minute, size) for minute, size in found if minute > 2]
    slope = float(np.polyfit(*zip(*later, strict=True), 1)[0]) if len(later) > 2 else math.nan
    return {
        "minutes": [round(minute, 1) for minute, _ in found],
        "heap_mb": [round(size, 2) for _, size in found],
        "growth_mb_an_hour": round(slope * 60, 3),
        "samples": page.evaluate("() => window.fed ?? null"),
        "main_thread_percent": round(100 * busy_s / (seconds * (LOOKS + 1) / LOOKS), 1),
    }
