"""Texts of others, as they are shown to people: on one line, with nothing in them that hides or reorders."""

# Characters that set the direction of what stands around them (Unicode UAX #9, section 2): a text that
# holds them can be shown in another order than it is read by a program (CVE-2021-42574).
DIRECTION = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
_SHOWN = {ord(each): f"<U+{ord(each):04X}>" for each in DIRECTION}


def one_line(text: str, longest: int = 200) -> str:
    """Return a text on one line, at most so many characters long.

    Control characters of direction are shown by their numbers; what else moves a cursor, colours or hides
    becomes a blank.
    """
    # Cut before anything else is done: who sends megabytes is not to be worked for.
    cut = show_direction(text[: longest + 1])
    plain = "".join(c if c.isprintable() else " " for c in cut[: longest + 1])
    return plain if len(plain) <= longest else plain[: longest - 1] + "…"


def show_direction(text: str) -> str:
    """Return a text whose control characters of direction are shown by their numbers: `<U+202E>`."""
    return text if text.isascii() else text.translate(_SHOWN)


def for_terminal(text: str) -> str:
    """Return lines for a terminal: only line ends, tabs and printable characters are left as they are.

    Escape sequences, which can move the cursor, colour, or answer as the keyboard, lose their first
    character; control characters of direction are shown by their numbers.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else _replaced(c) for c in text)


def _replaced(character: str) -> str:
    return _SHOWN.get(ord(character), " " if character.isspace() else "\N{REPLACEMENT CHARACTER}")
