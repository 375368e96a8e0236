"""Keys and the names in them."""

import pytest

from robomesh import keys


@pytest.mark.parametrize(("robot", "expected"), [("replay-1", True), ("arm", False), ("my-replay-1", False)])
def test_replay_is_known_by_its_robots_name(robot, expected):
    assert keys.is_replay(robot) is expected


def test_replays_robot_is_a_valid_name():
    name = keys.replay_name("a1b2")
    assert keys.is_replay(name)
    assert keys.parse_key(keys.robot_key("site", name, "joints")) == ("site", name, "joints")
