"""The Fleet page with many robots: times between frames in Chromium, at rest and while it is scrolled.

The robots run in a separate process, with our router and our console. Chromium draws in software on the main
processor, as it does without a GPU. Each round reopens the page, at the width of a phone and of a control
room. A browser without WebGL shows no pictures: in the same round it gives the cost of the rest of the page.

    ./dev run python benchmarks/fleet_page.py [--robots 200] [--rounds 3] [--seconds 5] [--json]

Target: p50 under 34 ms while the page is scrolled at 1440 px.
"""

import argparse
import contextlib
import json
import os
import statistics
import sys
import tempfile
from itertools import product
from pathlib import Path
from typing import Any

from latency import free_port, service, until_connectable
from playwright.sync_api import Browser, sync_playwright

if __name__ == "__main__":
    # Import from the root: a program in this folder has the same name as a package.
    sys.path[0] = str(Path(__file__).parents[1])

from tests.browser.conftest import ARGUMENTS, CHROMIUM, NO_WEBGL
from tests.browser.crowd import crowd
from web import build_page

SIZES = ((360, 740), (1440, 900))
SPEED_PX_S = 600
SETTLED_MS = 3000
OPENED_MS = 120_000

# Times between frames [ms]; the page scrolls down and up at the same speed on every machine.
FRAMES = """
([seconds, speed]) => new Promise((done) => {
  const times = [], began = performance.now();
  let before = began;
  const frame = () => {
    const at = performance.now();
    times.push(at - before);
    before = at;
    const most = document.scrollingElement.scrollHeight - innerHeight;
    const gone = (at - began) / 1000 * speed;
    if (speed) scrollTo({ top: Math.abs(((gone + most) % (2 * most)) - most), behavior: "instant" });
    if (at - began < seconds * 1000) requestAnimationFrame(frame);
    else done(times.slice(1));
  };
  requestAnimationFrame(frame);
})
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--robots", type=int, default=200)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=5.0, help="at rest, and then while scrolling")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    build_page.build()
    result = measure(arguments.robots, arguments.rounds, arguments.seconds)
    if arguments.json:
        print(json.dumps(result))
        return
    print(f"{result['robots']} robots, {result['cores']} cores, load {result['load']:.0f}")
    print("width  pictures             p50 ms (least, most)   p99 ms (least, most)   of so many rounds")
    for row in result["rows"]:
        for what in ("still", "scrolling"):
            p50, p99 = (row[what][name] for name in ("p50_ms", "p99_ms"))
            print(
                f"{row['width']:5}  {'yes' if row['pictures'] else 'no':4} {what:10} "
                f"{p50['median']:9.1f} ({p50['least']:.1f}, {p50['most']:.1f}) "
                f"{p99['median']:12.1f} ({p99['least']:.1f}, {p99['most']:.1f}) {p50['rounds']:6}"
            )


def measure(robots: int, rounds: int, seconds: float) -> dict[str, Any]:
    """Measure every width with and without pictures, in turn, for that number of rounds."""
    router, console = free_port(), free_port()
    endpoint, address = f"tcp/127.0.0.1:{router}", f"127.0.0.1:{console}"
    kinds = [(size, drawn) for size, drawn in product(SIZES, (True, False))]
    found: dict[Any, list[dict[str, list[float]]]] = {kind: [] for kind in kinds}
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        site = Path(folder) / "site.toml"
        site.write_text(
            f'site = "hall"\n[router]\nlisten = ["{endpoint}"]\n[console]\nlisten = "{address}"\n'
        )
        stack.enter_context(service("router", site, endpoint))
        until_connectable(router)
        stack.enter_context(service("console", site, endpoint))
        stack.enter_context(crowd(endpoint, ("hall", "yard"), robots))
        until_connectable(console)
        playwright = stack.enter_context(sync_playwright())
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=ARGUMENTS)
        for _ in range(rounds):
            for size, drawn in kinds:
                found[size, drawn].append(one(browser, f"http://{address}", size, drawn, robots, seconds))
        browser.close()
    rows = [
        {
            "width": size[0],
            "height": size[1],
            "pictures": drawn,
            **{what: _spread([each[what] for each in all_]) for what in ("still", "scrolling")},
        }
        for (size, drawn), all_ in found.items()
    ]
    return {"robots": robots, "cores": os.cpu_count(), "load": os.getloadavg()[0], "rows": rows}


def one(
    browser: Browser, address: str, size: tuple[int, int], drawn: bool, robots: int, seconds: float
) -> dict[str, list[float]]:
    """Open the page and return the times between its frames [ms]."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme="dark")
    if not drawn:
        page.add_init_script(NO_WEBGL)
    page.goto(f"{address}/")
    page.wait_for_function(
        "count => document.querySelectorAll('.tile').length === count", arg=robots, timeout=OPENED_MS
    )
    page.wait_for_selector(
        ".tile canvas[data-drawn]" if drawn else ".tile .state", state="attached", timeout=OPENED_MS
    )
    page.wait_for_timeout(SETTLED_MS)
    times = {
        "still": page.evaluate(FRAMES, [seconds, 0]),
        "scrolling": page.evaluate(FRAMES, [seconds, SPEED_PX_S]),
    }
    page.close()
    return times


def _spread(rounds: list[list[float]]) -> dict[str, dict[str, float]]:
    """Return the median, least and most of the rounds' p50 and p99 [ms]."""
    result = {}
    for name, share in (("p50_ms", 0.5), ("p99_ms", 0.99)):
        values = [sorted(times)[min(int(len(times) * share), len(times) - 1)] for times in rounds]
        result[name] = {
            "median": statistics.median(values),
            "least": min(values),
            "most": max(values),
            "rounds": len(values),
        }
    return result


if __name__ == "__main__":
    main()
