"""Tests find the page's parts by role, name and text, as a screen reader does, and not by structure."""

import ast
from pathlib import Path

BROWSER = Path(__file__).parent / "browser"
STRUCTURAL = {"locator", "query_selector", "query_selector_all", "wait_for_selector"}
# Functions that return what has no role: marks and canvases for the eye only, a path, another program's page.
ALLOWED = {
    "define/page.py": {"field"},
    "robot_page.py": {"drawings", "joint_track"},
    "test_embedding.py": {"test_a_listed_page_frames_one_view_without_controls_and_nothing_else"},
    "test_lichtblick.py": {"test_the_arm_has_the_silhouette_of_its_shapes_and_its_colours"},
    "test_recordings_page.py": {"curves_area", "moment_line"},
}


def structural(path):
    """Return the functions of a file that find something by a CSS selector."""
    found = set()
    for function in ast.parse(path.read_text()).body:
        calls = (each.func for each in ast.walk(function) if isinstance(each, ast.Call))
        if any(isinstance(call, ast.Attribute) and call.attr in STRUCTURAL for call in calls):
            found.add(getattr(function, "name", "the module"))
    return found


def test_only_these_functions_find_a_part_of_the_page_by_its_structure():
    found = {path.relative_to(BROWSER).as_posix(): structural(path) for path in BROWSER.rglob("*.py")}
    assert {name: functions for name, functions in found.items() if functions} == ALLOWED, (
        "use get_by_role, get_by_label or get_by_text; give what has neither role nor name one in the page"
    )
