"""The depth of strangers' JSON is bounded by our own count, on every version of Python."""

import json
import struct
import tracemalloc

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robomesh.bounded_json import MOST_DEPTH, _check_depth, loads
from robomesh.contract.messages import JSON, decode_request
from robomesh.errors import MessageError
from robomesh.schemas.robomesh_pb2 import ViewRequest
from robots.schema.errors import ShapeError
from robots.shapes.files.gltf import read_glb

VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(st.sampled_from('a"\\[]{}\n\u20ac')),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(st.sampled_from('"\\[]{}')), inner),
)


def nested(depth: int) -> str:
    return "[" * depth + "]" * depth


@pytest.mark.slow
@given(VALUES)
def test_values_are_those_of_json(value):
    text = json.dumps([value, "[" * MOST_DEPTH, '{"\\' * MOST_DEPTH], ensure_ascii=False)
    assert loads(text) == json.loads(text)
    assert loads(text.encode("utf-16")) == json.loads(text)


def test_nesting_ends_at_the_same_depth_everywhere():
    assert json.dumps(loads(nested(MOST_DEPTH))) == nested(MOST_DEPTH)
    wide = f"[{', '.join(['[[]]'] * 1000)}]"
    assert len(loads(wide)) == 1000
    for text in (
        nested(MOST_DEPTH + 1),
        '{"a":' * 101 + "1" + "}" * 101,
        "[" * 1_000_000,
        '["' + nested(200),
    ):
        with pytest.raises((RecursionError, ValueError)):
            loads(text)
    with pytest.raises(RecursionError, match="nested too deeply: at most 100 levels"):
        loads(nested(900))


@pytest.mark.slow
@pytest.mark.parametrize("part", [r"\n", r"\"", r"\\", "[],", '{"":[]},', '"[",'])
def test_the_depth_of_a_long_text_is_found_with_little_memory(part):
    inside = part * 100_000
    text = f"[{inside}[]]" if "," in part else f'[{"[]," * 200}"{inside}"]'
    tracemalloc.start()
    try:
        _check_depth(text)
        assert tracemalloc.get_traced_memory()[1] < 40 * len(text)
    finally:
        tracemalloc.stop()
    assert loads(text) == json.loads(text)


def test_messages_and_shapes_that_are_nested_too_deeply_are_refused():
    with pytest.raises(MessageError, match="nested too deeply"):
        decode_request(ViewRequest, b'{"of": %s}' % nested(900).encode(), JSON)
    chunk = nested(900).encode()
    parts = (b"glTF", 2, 20 + len(chunk), len(chunk), b"JSON", chunk)
    with pytest.raises(ShapeError, match="nested too deeply"):
        read_glb(struct.pack(f"<4sIII4s{len(chunk)}s", *parts))
