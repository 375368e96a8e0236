"""Texts of others on one line."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robomesh.texts import one_line


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("", ""),
        ("somebody in the cell", "somebody in the cell"),
        ("有人在里面", "有人在里面"),
        ("a\nERROR forged\r\tb", "a ERROR forged  b"),
        ("\x1b[2J\x00\u202e\u200b\u2028", " [2J <U+202E>  "),
        ("r" * 200, "r" * 200),
        ("r" * 201, "r" * 199 + "…"),
    ],
)
def test_what_moves_a_cursor_or_hides_becomes_a_blank_and_what_is_long_is_cut(text, shown):
    assert one_line(text) == shown


@given(st.text())
def test_whatever_is_sent_comes_out_printable_and_short(text):
    assert one_line(text, 20).isprintable()
    assert len(one_line(text, 20)) <= 20
