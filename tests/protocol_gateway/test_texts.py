"""Untrusted texts on one line."""

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
def test_control_characters_become_blanks_and_long_texts_are_shortened(text, shown):
    assert one_line(text) == shown


@given(st.text())
def test_any_text_becomes_printable_and_short(text):
    assert one_line(text, 20).isprintable()
    assert len(one_line(text, 20)) <= 20
