"""Cameras of a description."""

import json

import numpy as np
import pytest

from robots.descriptions.description import library_names, load, parse
from robots.descriptions.summary import description_summary
from robots.kinematics.model import build_model, tool_placement
from robots.kinematics.views import reach, views_of

CLOSE = """
[view.top]
eye = [0.0, 0.0, 2500.0]
target = [0.0, 0.0, 300.0]
up = [0.0, 1.0, 0.0]
projection = "orthographic"
[view.wrist]
eye = [500.0, 0.0, 500.0]
target = [0.0, 0.0, 500.0]
"""


@pytest.mark.parametrize("robot", library_names())
def test_top_front_and_left_views_exist_by_default(robot: str) -> None:
    views = {view.name: view for view in views_of(load(robot))}
    assert list(views) == ["top", "front", "left"]
    assert all(view.orthographic for view in views.values())
    assert (views["top"].eye - views["top"].target)[2] > 0
    assert (views["front"].eye - views["front"].target)[0] > 0
    assert (views["left"].eye - views["left"].target)[1] > 0


def test_described_views_replace_and_add_in_metres() -> None:
    description = load("pt600")
    views = {view.name: view for view in views_of(parse(description.text + CLOSE, description.source))}
    assert list(views) == ["top", "front", "left", "wrist"]
    assert views["top"].eye.tolist() == [0.0, 0.0, 2.5]
    assert not views["wrist"].orthographic


@pytest.mark.parametrize("robot", library_names())
def test_tool_never_exceeds_the_reach(robot: str) -> None:
    description = load(robot)
    model = build_model(description)
    generator = np.random.default_rng(11)
    farthest = max(
        np.linalg.norm(
            tool_placement(model, generator.uniform(model.joints.lower, model.joints.upper))[:3, 3]
        )
        for _ in range(300)
    )
    assert 0.5 * reach(description) < farthest <= reach(description)


@pytest.mark.parametrize("robot", library_names())
def test_summary_is_plain_json(robot: str) -> None:
    summary = description_summary(load(robot))
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary
