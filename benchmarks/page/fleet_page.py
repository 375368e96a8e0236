"""The Fleet page with many robots: times between frames in Chromium, at rest and while it is scrolled.

The robots run in a separate process, with our router and our console. Chromium draws in software on the main
processor, as it does without a GPU. Each round reopens the page, at the width of a phone and of a control
room. A browser without WebGL shows no pictures: in the same round it gives the cost of the rest of the page.

    ./dev run python -m benchmarks fleet_page [--robots 200] [--rounds 3] [--seconds 5] [--json]

Target: p50 under 34 ms while the page is scrolled at 1440 px.
"""

from functools import partial
from itertools import product
from typing import Annotated, Any

from playwright.sync_api import Browser
from typer import Option

from benchmarks.harness.sites import running_site
from benchmarks.harness.turns import in_turns, percentile, spread
from benchmarks.page.browser import NO_WEBGL, chromium
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


def measure(
    robots: int = 200,
    rounds: int = 3,
    seconds: Annotated[float, Option(help="at rest, and then while scrolling")] = 5.0,
) -> dict[str, Any]:
    """Measure every width with and without pictures, in turn, for that number of rounds."""
    build_page.build()
    with (
        running_site("console", name="hall") as site,
        crowd(site.endpoint, ("hall", "yard"), robots),
        chromium() as browser,
    ):
        address = f"http://{site.console}"
        found = in_turns(
            {
                (size, drawn): partial(one, browser, address, size, drawn, robots, seconds)
                for size, drawn in product(SIZES, (True, False))
            },
            rounds,
        )
    rows = [
        {
            "width": size[0],
            "height": size[1],
            "pictures": drawn,
            **{what: _spread([each[what] for each in times]) for what in ("still", "scrolling")},
        }
        for (size, drawn), times in found.items()
    ]
    return {"robots": robots, "rows": rows}


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
    for percent in (50, 99):
        values = [percentile(times, percent) for times in rounds]
        result[f"p{percent}_ms"] = {**spread(values), "rounds": len(values)}
    return result
