"""Lists in texts; untrusted texts for display: on one line, without characters that hide or reorder text."""

import re
import unicodedata

# Characters that set the direction of the text around them (Unicode UAX #9, section 2): people may see such a
# text in another order than a program reads it (CVE-2021-42574).
DIRECTION = "\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069"
# Characters that a file's name has on no system, or not on every one.
_IN_NO_FILE_NAME = re.compile(r'[/\\:*?"<>|]')
_SHOWN = {ord(each): f"<U+{ord(each):04X}>" for each in DIRECTION}


def split_commas(text: str) -> tuple[str, ...]:
    """Return the parts of a list with commas."""
    return tuple(part for each in text.split(",") if (part := each.strip()))


def one_line(text: str, longest: int = 200) -> str:
    """Return a text on one line, at most `longest` characters long.

    Shows direction characters by their numbers; replaces other control characters by blanks.
    """
    # Cut first: a text of megabytes must not cost time.
    cut = show_direction(text[: longest + 1])
    plain = "".join(c if c.isprintable() else " " for c in cut[: longest + 1])
    return plain if len(plain) <= longest else plain[: longest - 1] + "…"


def is_file_title(text: str, longest: int) -> bool:
    """Return whether a name can become a file's name on any system, and shows as what it is."""
    return (
        0 < len(text) <= longest
        and text.isprintable()
        and not any(each in DIRECTION for each in text)
        and not _IN_NO_FILE_NAME.search(text)
        and not text.startswith(".")
        and not text.endswith(".")
    )


def show_direction(text: str) -> str:
    """Return a text with its direction characters replaced by their numbers: `<U+202E>`."""
    return text if text.isascii() else text.translate(_SHOWN)


def for_terminal(text: str, *, keep: str = "\n\t") -> str:
    """Return a text without characters that a terminal interprets or hides: they are shown by their numbers.

    An escape sequence can move the cursor, colour, set a title, or answer as the keyboard. `<U+001B>`, which
    begins it, cannot.

    Args:
        text: One line or several.
        keep: Control characters that stay; none for a value that must not begin a new line.
    """
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() or each in keep else _shown(each) for each in text)


def _shown(character: str) -> str:
    # Blanks of other widths are harmless.
    return " " if unicodedata.category(character) == "Zs" else f"<U+{ord(character):04X}>"
