"""Keys and the names in them."""

import pytest

from robomesh.contract import keys
from robomesh.errors import KeyNameError
from robomesh.wire.session import open_session


@pytest.mark.parametrize(("robot", "expected"), [("replay-1", True), ("arm", False), ("my-replay-1", False)])
def test_replay_is_known_by_its_robots_name(robot, expected):
    assert keys.is_replay(robot) is expected


def test_replays_robot_is_a_valid_name():
    name = keys.replay_name("a1b2")
    assert keys.is_replay(name)
    assert keys.parse_key(keys.robot_key("site", name, "joints")) == ("site", name, "joints")


def test_parsed_key_is_not_parsed_again():
    key = keys.parse_key("robomesh/site/arm/joints")
    assert keys.parse_expression(key) is key


@pytest.mark.parametrize("key", [("site", "Arm", "joints"), ("site", "arm", "a b"), ("*", "arm", "joints")])
def test_invalid_chunk_of_a_parsed_key_is_an_error(key):
    with pytest.raises(KeyNameError):
        keys.parse_key(str(keys.Key(*key)))


async def test_request_is_parsed_once_by_its_client_and_once_by_its_owner(mesh, monkeypatch):
    parse, parsed = keys.parse_expression, []

    def count(key):
        if not isinstance(key, keys.Key):
            parsed.append(key)
        return parse(key)

    async def shape_of(request):
        return b"mesh"

    async with open_session(mesh) as owner, open_session(mesh) as client:
        owner.answer("site", "arm", "mesh/*", shape_of)
        key = "robomesh/site/arm/mesh/base"
        await client.ask_bytes(key, timeout_s=20.0)
        monkeypatch.setattr(keys, "parse_expression", count)
        keys.parse_key.cache_clear()
        await client.ask_bytes(key)
        assert parsed == [key, key]
        keys.parse_key.cache_clear()
        await client.ask_bytes(keys.Key("site", "arm", "mesh/base"))
        assert parsed == [key, key, key]
