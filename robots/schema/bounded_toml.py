"""TOML parser with limits on length and nesting.

Python's parser stores every prefix of a dotted key, so the memory for a key of n parts grows with n squared:
20,000 parts, a file of 40 KB, take 1.6 GB. Deeply nested values raise RecursionError. Both are checked before
parsing.
"""

import re
import tomllib
from pathlib import Path
from typing import Any

MOST_CHARACTERS = 4_000_000
MOST_DEPTH = 32

# Strings and comments are taken out first, because they may contain text that looks like a key, a bracket or
# each other. The end of each is searched from its begin; text without one is not TOML, and nothing after its
# begin is parsed. All searches go forward, so the time is linear. Possessive quantifiers would also do, but
# Python 3.11.2 matches them wrongly.
_BEGIN = re.compile(r"""\"{3}|'{3}|["'#]""")
_ENDS = {
    '"""': re.compile(r'\\.|"{3,5}', re.DOTALL),
    "'''": re.compile(r"'{3,5}"),
    '"': re.compile(r'\\.|["\n]', re.DOTALL),
    "'": re.compile(r"['\n]"),
    "#": re.compile(r"$", re.MULTILINE),
}
_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]+[ \t]*\.[ \t]*){{{MOST_DEPTH}}}")
_BRACKET = re.compile(r"[\[\]{}]")


class _TomlError(tomllib.TOMLDecodeError):
    """An error without a place; since Python 3.14 the base class warns of one."""

    def __init__(self, problem: str) -> None:
        ValueError.__init__(self, problem)


def read_toml(path: Path) -> dict[str, Any]:
    """Parse a TOML file.

    Raises:
        OSError: If the file cannot be read.
        UnicodeDecodeError: If the file is not UTF-8.
        tomllib.TOMLDecodeError: See `parse_toml`.
    """
    with path.open(encoding="utf-8") as file:
        return parse_toml(file.read(MOST_CHARACTERS + 1))


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML text.

    Raises:
        tomllib.TOMLDecodeError: If the text is not TOML, is longer than MOST_CHARACTERS, is nested deeper
            than MOST_DEPTH, has a key of more than MOST_DEPTH parts, or a number with too many digits.
    """
    check_bounds(text)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except (ValueError, RecursionError) as error:  # a number of too many digits is a plain ValueError
        raise _TomlError(str(error)) from None


def check_bounds(text: str) -> None:
    """Reject TOML text that is too expensive to parse.

    Raises:
        tomllib.TOMLDecodeError: If the text is longer than MOST_CHARACTERS or nested deeper than MOST_DEPTH.
    """
    if len(text) > MOST_CHARACTERS:
        raise _TomlError(f"the file is longer than {MOST_CHARACTERS:,} characters")
    bare = _bare(text)
    long_key = _LONG_KEY.search(bare)
    if long_key is not None:
        raise _TomlError(f"a key has more than {MOST_DEPTH} parts: '{long_key[0][:40]}...'")
    depth = 0
    for bracket in _BRACKET.finditer(bare):
        depth += 1 if bracket[0] in "[{" else -1
        if depth > MOST_DEPTH:
            raise _TomlError(f"tables and lists are nested deeper than {MOST_DEPTH}")


def _bare(text: str) -> str:
    """Return the text without comments and with "s" for each string, up to a string that does not end."""
    parts = []
    at = 0
    while (begin := _BEGIN.search(text, at)) is not None:
        parts.append(text[at : begin.start()])
        found = _ENDS[begin[0]].finditer(text, begin.end())
        end = next((each for each in found if not each[0].startswith("\\")), None)
        if end is None:
            return "".join(parts)
        parts.append("" if begin[0] == "#" else "s")
        at = end.end()
    return "".join((*parts, text[at:]))
