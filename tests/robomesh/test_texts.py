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


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\x1b[2J\x00\x07\x7f", "a<U+001B>[2J<U+0000><U+0007><U+007F>"),
        ("\x9b31m\x85", "<U+009B>31m<U+0085>"),  # C1: one character instead of escape and bracket
        ("a\r\n\tb\x0b\x0c", "a<U+000D>\n\tb<U+000B><U+000C>"),
        ("\u200b\u2060\ufeff\u2028\U000e0041", "<U+200B><U+2060><U+FEFF><U+2028><U+E0041>"),
        ("\ud800\udcff", "<U+D800><U+DCFF>"),
        ("1\u00a0000\u3000m", "1 000 m"),
    ],
)
def test_a_terminal_gets_no_character_that_it_interprets_or_hides(text, shown):
    assert for_terminal(text) == shown


def test_a_value_on_one_line_begins_no_line():
    assert for_terminal("on\n\tforged", keep="") == "on<U+000A><U+0009>forged"


def test_truncated_text_keeps_the_length_limit():
    assert len(one_line("\u202e" * 1000, 20)) == 20
