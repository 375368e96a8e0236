"""TOML text parsed within bounds on its length and depth.

Python's parser remembers every beginning of a dotted key: the memory for one of n parts grows with n
squared (20,000 parts, a file of 40 KB, take 1.6 GB), and values that are nested deeply end in a
RecursionError. So both are looked at before parsing.
"""

import re
import tomllib
from pathlib import Path
from typing import Any

MOST_CHARACTERS = 4_000_000
MOST_DEPTH = 32

# Strings first: what looks like a key, a bracket or a comment inside them is none.
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
        OSError: If it cannot be read.
        UnicodeDecodeError: If it is not UTF-8.
        tomllib.TOMLDecodeError: As `parse_toml`.
    """
    with path.open(encoding="utf-8") as file:
        return parse_toml(file.read(MOST_CHARACTERS + 1))


def parse_toml(text: str) -> dict[str, Any]:
    """Parse TOML text.

    Raises:
        tomllib.TOMLDecodeError: If it is not TOML, longer than MOST_CHARACTERS, nested deeper than
            MOST_DEPTH, or holds a key of more parts or a number of more digits than Python reads.
    """
    check_bounds(text)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except (ValueError, RecursionError) as error:  # a number of too many digits is a plain ValueError
        raise tomllib.TOMLDecodeError(str(error)) from None


def check_bounds(text: str) -> None:
    """Refuse TOML text that would cost its parser too much.

    Raises:
        tomllib.TOMLDecodeError: If it is longer than MOST_CHARACTERS or nested deeper than MOST_DEPTH.
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
