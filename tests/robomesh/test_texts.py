"""Untrusted texts cannot reorder or hide the text around them."""

import pytest

from robomesh.texts import DIRECTION, for_terminal, one_line, show_direction

# The three attacks of "Trojan Source" (Boucher, Anderson 2021; CVE-2021-42574), as printed there.
STRETCHED = 'if access_level != "user\u202e \u2066// Check if admin\u2069 \u2066" {'
COMMENTING_OUT = "/*\u202e } \u2066if (isAdmin)\u2069 \u2066 begin admins only */"
EARLY_RETURN = "\u2067''' ;return\u2066 \u2067"


@pytest.mark.parametrize("text", [STRETCHED, COMMENTING_OUT, EARLY_RETURN, DIRECTION])
@pytest.mark.parametrize("shown", [one_line, show_direction, for_terminal])
def test_direction_characters_are_shown_by_their_numbers(text, shown):
    output = shown(text)
    assert not set(output) & set(DIRECTION)
    for control in set(text) & set(DIRECTION):
        assert output.count(f"<U+{ord(control):04X}>") == text.count(control)


def test_right_to_left_text_is_unchanged():
    for text in ("הזרוע עצרה", "توقف الذراع", "有人在里面", "plain"):
        assert one_line(text) == show_direction(text) == for_terminal(text) == text


def test_terminal_gets_no_escape_sequence():
    assert for_terminal("a\x1b[2Jb\x9b31m\r\n\tc") == "a�[2Jb�31m \n\tc"


def test_truncated_text_keeps_the_length_limit():
    assert len(one_line("\u202e" * 1000, 20)) == 20
