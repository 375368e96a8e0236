"""Answers of many sizes, with last pieces of any length."""

import pytest

from robomesh.wire.session import open_session


@pytest.mark.parametrize("size", [40_956, 133_596, 187_244, 241_624, 3_000_000])
async def test_answer_of_any_size_arrives_with_one_request(mesh, size):
    async with open_session(mesh) as owner, open_session(mesh) as asker:
        asked = []

        async def shape_of(request):
            asked.append(request.chunk)
            return b"\x5a" * size

        owner.answer("hall", "arm", "mesh/*", shape_of)
        answer = await asker.ask_bytes("robomesh/hall/arm/mesh/base", timeout_s=40.0)
        assert answer == b"\x5a" * size
        assert asked == ["base"]
