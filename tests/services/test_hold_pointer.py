"""The table of a held press, and where a step of the tool leads, of the page in Node."""

import numpy as np
import pinocchio
import pytest

from tests import page_modules

pytestmark = pytest.mark.slow

STATES = ("idle", "resting", "held", "spent")
INTERRUPTIONS = ("left", "other", "cancelled", "blur", "focus", "hidden", "dialog", "covered", "locked")
INPUTS = ("pressed", "touched", "rested", "strayed", "released", "lifted", *INTERRUPTIONS)
# Everything else changes nothing.
TABLE = {
    ("idle", "pressed"): "held",
    ("idle", "touched"): "resting",
    ("resting", "rested"): "held",
    ("resting", "strayed"): "spent",
    ("resting", "released"): "idle",
    ("held", "released"): "idle",
    ("spent", "lifted"): "idle",
    **{(state, end): "spent" for state in ("resting", "held") for end in INTERRUPTIONS},
}
BOX = {"left": 100, "right": 136, "top": 50, "bottom": 82}


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    """Return the path of the page's modules as one file for Node."""
    return page_modules.bundle(
        tmp_path_factory.mktemp("hold"),
        hold="ui/hold/hold-pointer.ts",
        step="features/robot/motion/tool-step.ts",
    )


def ask(module, call, *asked):
    return page_modules.ask(module, f"answer(asked.map((each) => page.{call}(...each) ?? null));", asked)


def test_every_input_of_every_state_leads_where_the_table_says(module):
    cases = [(state, given) for state in STATES for given in INPUTS]
    assert ask(module, "nextState", *cases) == [TABLE.get(case, case[0]) for case in cases]


@pytest.mark.parametrize(
    ("state", "to", "expected"),
    [
        ("resting", (117, 66), None),
        ("resting", (110 + 7.9, 66), None),
        ("resting", (110, 66 + 8), "strayed"),
        ("resting", (110 - 6, 66 - 6), "strayed"),
        ("held", (110, 82), None),
        ("held", (136 + 15.9, 82 + 15.9), None),
        ("held", (136 + 16, 66), "left"),
        ("held", (100 - 16, 66), "left"),
        ("held", (110, 50 - 16), "left"),
        ("held", (110, 82 + 16), "left"),
        ("idle", (500, 500), None),
        ("spent", (500, 500), None),
    ],
)
def test_a_touch_strays_by_8_px_and_a_held_pointer_leaves_by_16(module, state, to, expected):
    from_, to = {"x": 110, "y": 66}, dict(zip("xy", to, strict=True))
    assert ask(module, "moveInput", (state, from_, to, BOX)) == [expected]


def test_only_the_main_button_alone_goes_on(module):
    assert ask(module, "buttonsInput", *([each] for each in range(5))) == [
        "released",
        None,
        "released",
        "other",
        "released",
    ]


@pytest.mark.parametrize("frame", ["tool", "base", "site"])
@pytest.mark.parametrize("axis", ["x", "y", "z", "roll", "pitch", "yaw"])
def test_a_step_of_the_tool_ends_where_the_page_says(module, frame, axis):
    pose, site = np.eye(4), np.eye(4)
    pose[:3, :3] = pinocchio.rpy.rpyToMatrix(*np.radians([20, -50, 110]))
    pose[:3, 3] = 0.3, -0.2, 0.5
    site[:3, :3] = pinocchio.rpy.rpyToMatrix(*np.radians([5, 15, 90]))
    number = ["x", "y", "z", "roll", "pitch", "yaw"].index(axis)
    axes = {"tool": pose[:3, :3], "base": np.eye(3), "site": site[:3, :3].T}[frame]
    expected = pose.copy()
    if number < 3:
        expected[:3, 3] += axes[:, number] * 0.02
    else:
        turn = pinocchio.AngleAxis(np.radians(20), axes[:, number - 3]).toRotationMatrix()
        expected[:3, :3] = turn @ pose[:3, :3]
    step = {"axis": axis, "frame": frame, "amount": 20}
    (found,) = ask(module, "poseAfter", (list(pose.flat), step, list(site.flat)))
    assert np.array(found).reshape(4, 4) == pytest.approx(expected, abs=1e-12)
