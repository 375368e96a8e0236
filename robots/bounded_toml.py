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

# Match strings first, because they may contain text that looks like a key, a bracket or a comment.
_STRING_OR_COMMENT = re.compile(
    r"""
      \"{3} (?: [^"\\]++ | \\. | "{1,2}(?!") )*+ "{3,5}
    | '{3} (?: [^']++ | '{1,2}(?!') )*+ '{3,5}
    | " (?: [^"\\\n]++ | \\. )*+ "
    | ' [^'\n]*+ '
    | \# [^\n]*+
    """,
    re.VERBOSE | re.DOTALL,
)
_LONG_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{MOST_DEPTH}}}")
_BRACKET = re.compile(r"[\[\]{}]")


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
        raise tomllib.TOMLDecodeError(str(error)) from None


def check_bounds(text: str) -> None:
    """Reject TOML text that is too expensive to parse.

    Raises:
        tomllib.TOMLDecodeError: If the text is longer than MOST_CHARACTERS or nested deeper than MOST_DEPTH.
    """
    if len(text) > MOST_CHARACTERS:
        raise tomllib.TOMLDecodeError(f"the file is longer than {MOST_CHARACTERS:,} characters")
    bare = _STRING_OR_COMMENT.sub(lambda found: "" if found[0][0] == "#" else "s", text)
    long_key = _LONG_KEY.search(bare)
    if long_key is not None:
        raise tomllib.TOMLDecodeError(f"a key has more than {MOST_DEPTH} parts: '{long_key[0][:40]}...'")
    depth = 0
    for bracket in _BRACKET.finditer(bare):
        depth += 1 if bracket[0] in "[{" else -1
        if depth > MOST_DEPTH:
            raise tomllib.TOMLDecodeError(f"tables and lists are nested deeper than {MOST_DEPTH}")
