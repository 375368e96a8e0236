"""The Robot page in a Chromium that draws in software: its first screen, its cost, its answers, its memory.

A site runs as real processes: an arm at rest, whose joint states still arrive at 100 Hz, and one that moves.
`load`: first paint, joint names, and what is transferred until then, each time in a new browser context.
`cost`: processor time of the browser's processes and the number of drawn pictures, at rest and moving.
`busy`: how late the page's main thread answers a timer while other processes use both cores.
`heap`: the page's JavaScript heap after garbage collection, twice a minute, and its slope.

    ./dev run python -m benchmarks robot_page [--only load,cost,busy,heap] [--seconds 20] [--rounds 5]
                                              [--minutes 15] [--json]

Targets on two idle cores: first paint under 1 s, joint names under 2 s, at most 350 kB until then; a timer
is answered within 500 ms; no growth of the heap.
"""

import contextlib
import time
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from playwright.sync_api import Browser, CDPSession, Page
from typer import Option

from benchmarks.harness.burners import burning
from benchmarks.harness.program import chosen
from benchmarks.harness.turns import spread
from benchmarks.page.browser import PATIENCE_MS, chromium, site_for_page

PARTS = ("load", "cost", "busy", "heap")
ROBOTS = "\n".join(
    f'[[robot]]\nname = "{name}"\nmodel = "pt600"\ndemo = {demo}\n'
    for name, demo in (("resting", "false"), ("moving", "true"))
)
STARTED_S = 10.0
SETTLED_MS = 5_000
LEVEL_S = 60.0  # then the plot shows only rest
BURNERS = 2
TIMER_MS = 50
LATE_MS = 500

# The time of the first joint name [ms since the navigation began].
NOTE_JOINTS = """
new MutationObserver((_, observer) => {
  if (!document.querySelector(".joint-name")) return;
  window.jointsAt = performance.now();
  observer.disconnect();
}).observe(document, { childList: true, subtree: true });
"""
PAINTED = """() => new Promise((done) => new PerformanceObserver((list) => done(
  list.getEntriesByName("first-contentful-paint")[0].startTime
)).observe({ type: "paint", buffered: true }))"""
# How late each timer ran [ms].
LATENESS = """([seconds, interval]) => new Promise((done) => {
  const late = [], began = performance.now();
  let due = began + interval;
  const timer = setInterval(() => {
    const at = performance.now();
    late.push(Math.max(0, at - due));
    due = at + interval;
    if (at - began > seconds * 1000) { clearInterval(timer); done(late); }
  }, interval);
})"""
DRAWN = """() => Object.fromEntries([["scene", ".canvas-place canvas"], ["plot", ".plot"]]
  .map(([name, place]) => [name, Number(document.querySelector(place)?.dataset.drawn) || 0]))"""


def measure(
    only: str = ",".join(PARTS),
    seconds: Annotated[float, Option(help="of each measurement of cost and busy")] = 20.0,
    rounds: Annotated[int, Option(help="of load")] = 5,
    minutes: Annotated[float, Option(help="of heap")] = 15.0,
) -> dict[str, Any]:
    """Run the wanted parts in one site and one browser."""
    wanted, result = chosen("--only", only, PARTS), dict[str, Any]()
    with site_for_page(ROBOTS) as site, chromium() as browser:
        time.sleep(STARTED_S)
        address = f"{site.console}#/test"
        if "load" in wanted:
            result["load"] = load(browser, f"{address}/resting", rounds)
        if "cost" in wanted:
            result["cost"] = {
                robot: cost(browser, f"{address}/{robot}", seconds, settled_s)
                for robot, settled_s in (("resting", LEVEL_S), ("moving", 0.0))
            }
        if "busy" in wanted:
            result["busy"] = {
                robot: busy(browser, f"{address}/{robot}", seconds) for robot in ("resting", "moving")
            }
        if "heap" in wanted:
            result["heap"] = heap(browser, f"{address}/moving", minutes)
    return result


@contextlib.contextmanager
def opened(
    browser: Browser, address: str, width: int = 1440, height: int = 900
) -> Iterator[tuple[Page, CDPSession]]:
    """Open the page in a new context, until it is drawn completely."""
    context = browser.new_context(viewport={"width": width, "height": height}, color_scheme="dark")
    page = context.new_page()
    page.goto(address)
    page.wait_for_selector('.canvas-place canvas[data-loaded="true"]', timeout=PATIENCE_MS)
    page.wait_for_selector(".camera canvas[data-drawn]", timeout=PATIENCE_MS)
    page.wait_for_timeout(SETTLED_MS)
    try:
        yield page, context.new_cdp_session(page)
    finally:
        context.close()


def load(browser: Browser, address: str, rounds: int) -> dict[str, Any]:
    """Measure the first paint [ms], the joint names [ms], and the bytes until then."""
    rows = [one_load(browser, address) for _ in range(rounds)]
    return {name: spread([row[name] for row in rows]) for name in rows[0]}


def one_load(browser: Browser, address: str) -> dict[str, float]:
    context = browser.new_context(viewport={"width": 1440, "height": 900}, color_scheme="dark")
    page = context.new_page()
    page.add_init_script(NOTE_JOINTS)
    network = context.new_cdp_session(page)
    network.send("Network.enable")
    received: list[tuple[float, int]] = []
    network.on("Network.dataReceived", lambda of: received.append((of["timestamp"], of["encodedDataLength"])))
    messages: list[tuple[float, int]] = []
    network.on(
        "Network.webSocketFrameReceived",
        lambda of: messages.append((of["timestamp"], len(of["response"]["payloadData"]) * 3 // 4)),
    )
    began: list[float] = []
    network.on("Network.requestWillBeSent", lambda of: began.append(of["timestamp"]))
    page.goto(address)
    page.wait_for_selector(".joint-name", timeout=PATIENCE_MS)
    painted = page.evaluate(PAINTED)
    joints = page.evaluate("jointsAt")
    page.wait_for_timeout(2000)
    until = began[0] + joints / 1000
    files, mesh = (sum(size for at, size in of if at <= until) / 1000 for of in (received, messages))
    context.close()
    return {"painted_ms": painted, "joints_ms": joints, "files_kb": files, "messages_kb": mesh}


def cost(browser: Browser, address: str, seconds: float, settled_s: float) -> dict[str, Any]:
    """Measure the share of a core that each kind of process uses, and the pictures a second."""
    processes = browser.new_browser_cdp_session()
    with opened(browser, address) as (page, _):
        page.wait_for_timeout(1000 * settled_s)
        began, before, drawn = time.monotonic(), used(processes), page.evaluate(DRAWN)
        page.wait_for_timeout(1000 * seconds)
        gone, after, later = time.monotonic() - began, used(processes), page.evaluate(DRAWN)
    processes.detach()
    return {
        "cores": {kind: round((after[kind] - before.get(kind, 0.0)) / gone, 3) for kind in after},
        "pictures_per_s": {name: round((later[name] - drawn[name]) / gone, 2) for name in later},
    }


def used(processes: CDPSession) -> dict[str, float]:
    """Return the processor time of the browser's processes [s] by kind."""
    times: dict[str, float] = {}
    for each in processes.send("SystemInfo.getProcessInfo")["processInfo"]:
        times[each["type"]] = times.get(each["type"], 0.0) + each["cpuTime"]
    return times


def busy(browser: Browser, address: str, seconds: float) -> dict[str, Any]:
    """Measure how late the main thread answers a timer while other processes use the cores [ms]."""
    with opened(browser, address) as (page, _), burning(BURNERS):
        drawn = page.evaluate(DRAWN)
        late = np.array(page.evaluate(LATENESS, [seconds, TIMER_MS]))
        later = page.evaluate(DRAWN)
    return {
        **{f"p{share}_ms": round(float(np.percentile(late, share)), 1) for share in (50, 90, 99)},
        "most_ms": round(float(late.max()), 1),
        "over_500_ms": int((late > LATE_MS).sum()),
        "timers": len(late),
        "pictures_per_s": {name: round((later[name] - drawn[name]) / seconds, 2) for name in later},
    }


def heap(browser: Browser, address: str, minutes: float) -> dict[str, Any]:
    """Measure the heap after garbage collection [MB] and its slope [kB a minute] without the first fifth."""
    # The heap does not depend on the size; drawing in software does.
    with opened(browser, address, 640, 480) as (page, session):
        sizes: list[float] = []
        for _ in range(round(2 * minutes) + 1):
            session.send("HeapProfiler.collectGarbage")
            sizes.append(session.send("Runtime.getHeapUsage")["usedSize"] / 1e6)
            page.wait_for_timeout(30_000)
    kept = sizes[len(sizes) // 5 :]
    slope = float(np.polyfit(np.arange(len(kept)) / 2, kept, 1)[0]) * 1000
    return {"sizes_mb": [round(size, 3) for size in sizes], "slope_kb_per_minute": round(slope, 2)}
