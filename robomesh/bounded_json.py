"""JSON parser for what strangers send, with a limit on nesting.

An interpreter's own limit differs between versions: Python 3.13 parses what 3.11 refuses, and the code that
goes through the values then fails.
"""

import json
import re
from typing import Any

MOST_DEPTH = 100

_NO_BRACKETS = re.compile(r"[^\[\]{}]+")


def loads(data: str | bytes | bytearray, **options: Any) -> Any:
    """Parse JSON as `json.loads` does.

    Args:
        options: As for `json.loads`.

    Raises:
        ValueError: If it is not JSON.
        RecursionError: If it is nested deeper than MOST_DEPTH.
    """
    text = data if isinstance(data, str) else data.decode(json.detect_encoding(data), "surrogatepass")
    if text.count("[") + text.count("{") > MOST_DEPTH:
        _check_depth(text)
    return json.loads(text, **options)


def _check_depth(text: str) -> None:
    """Remove the innermost pairs of brackets once for each level; this takes little time for any text.

    Raises:
        RecursionError: If brackets are left.
    """
    outside = "".join(text.replace("\\\\", "").replace('\\"', "").split('"')[::2])
    brackets = _NO_BRACKETS.sub("", outside)
    for _ in range(MOST_DEPTH):
        if not brackets:
            return
        brackets = brackets.replace("[]", "").replace("{}", "")
    if brackets:
        raise RecursionError(
            f"nested too deeply: at most {MOST_DEPTH} levels are possible; or its brackets do not match"
        )
