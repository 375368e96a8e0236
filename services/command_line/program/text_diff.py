"""The difference of two texts as a unified diff, which `patch` and `git apply` read.

Myers' algorithm ("An O(ND) Difference Algorithm and Its Variations", 1986) finds the fewest changed lines.
The standard library's `difflib` changes more lines than necessary, and takes minutes for many equal ones.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

_CONTEXT = 3
# Texts with more changed lines are one change from the first changed line to the last.
_MOST_CHANGES = 1000
_NO_LINE_END = "\\ No newline at end of file\n"


class Change(NamedTuple):
    """Lines `old[old_begin:old_end]` become `new[new_begin:new_end]`."""

    old_begin: int
    old_end: int
    new_begin: int
    new_end: int


def unified_diff(old: str, new: str, old_name: str, new_name: str) -> str:
    """Return a unified diff with three lines of context; empty for equal texts."""
    old_lines, new_lines = _lines(old), _lines(new)
    found = changes(old_lines, new_lines)
    if not found:
        return ""
    return "".join(
        [
            f"--- {old_name}\n+++ {new_name}\n",
            *(_hunk(group, old_lines, new_lines) for group in _grouped(found)),
        ]
    )


def changes(old: Sequence[str], new: Sequence[str]) -> list[Change]:
    """Return the changes from one list of lines to another, in their order."""
    most = min(len(old), len(new))
    begin = next((i for i in range(most) if old[i] != new[i]), most)
    same = next((i for i in range(most - begin) if old[-1 - i] != new[-1 - i]), most - begin)
    old_end, new_end = len(old) - same, len(new) - same
    found: list[Change] = []
    kept = _kept(old[begin:old_end], new[begin:new_end])
    before = (0, 0)
    for x, y in (*kept, (old_end - begin, new_end - begin)):
        if (x, y) != before:
            found.append(Change(begin + before[0], begin + x, begin + before[1], begin + y))
        before = x + 1, y + 1
    return found


def _kept(old: Sequence[str], new: Sequence[str]) -> list[tuple[int, int]]:
    """Return the indices of the lines that both lists keep; none if too many differ."""
    furthest = {1: 0}
    trace: list[dict[int, int]] = []
    for count in range(min(len(old) + len(new), _MOST_CHANGES) + 1):
        trace.append(dict(furthest))
        for diagonal in range(-count, count + 1, 2):
            inserted = _is_insertion(furthest, diagonal, count)
            x = furthest[diagonal + 1] if inserted else furthest[diagonal - 1] + 1
            y = x - diagonal
            while x < len(old) and y < len(new) and old[x] == new[y]:
                x, y = x + 1, y + 1
            furthest[diagonal] = x
            if x >= len(old) and y >= len(new):
                return _back(trace, len(old), len(new))
    return []


def _is_insertion(furthest: dict[int, int], diagonal: int, count: int) -> bool:
    """Return whether a diagonal is reached furthest by inserting a line, not by deleting one."""
    if abs(diagonal) == count:
        return diagonal == -count
    return furthest[diagonal - 1] < furthest[diagonal + 1]


def _back(trace: Sequence[dict[int, int]], x: int, y: int) -> list[tuple[int, int]]:
    """Return the kept lines on the way back from the end of both lists."""
    kept = []
    for count in range(len(trace) - 1, -1, -1):
        diagonal, furthest = x - y, trace[count]
        inserted = _is_insertion(furthest, diagonal, count)
        begin = furthest[diagonal + 1] if inserted else furthest[diagonal - 1] + 1
        while x > max(begin, 0) and y > 0:
            x, y = x - 1, y - 1
            kept.append((x, y))
        x, y = (x, y - 1) if inserted else (x - 1, y)
    return kept[::-1]


def _grouped(found: Sequence[Change]) -> Iterator[list[Change]]:
    """Group changes whose lines of context meet."""
    group: list[Change] = []
    for change in found:
        if group and change.old_begin - group[-1].old_end > 2 * _CONTEXT:
            yield group
            group = []
        group.append(change)
    yield group


def _hunk(group: Sequence[Change], old: Sequence[str], new: Sequence[str]) -> str:
    before = min(_CONTEXT, group[0].old_begin)
    after = min(_CONTEXT, len(old) - group[-1].old_end)
    old_begin, new_begin = group[0].old_begin - before, group[0].new_begin - before
    old_end, new_end = group[-1].old_end + after, group[-1].new_end + after
    parts = [f"@@ -{_range(old_begin, old_end)} +{_range(new_begin, new_end)} @@\n"]
    at = old_begin
    for change in group:
        parts += (_line(" ", line) for line in old[at : change.old_begin])
        parts += (_line("-", line) for line in old[change.old_begin : change.old_end])
        parts += (_line("+", line) for line in new[change.new_begin : change.new_end])
        at = change.old_end
    parts += (_line(" ", line) for line in old[at:old_end])
    return "".join(parts)


def _range(begin: int, end: int) -> str:
    """Return a range of lines as POSIX writes it: the length is left out if it is 1."""
    if end - begin == 1:
        return f"{end}"
    return f"{begin + (end > begin)},{end - begin}"


def _lines(text: str) -> list[str]:
    """Return the lines with their ends; only a line feed ends a line, as for `diff`."""
    lines = text.split("\n")
    return [f"{line}\n" for line in lines[:-1]] + ([lines[-1]] if lines[-1] else [])


def _line(sign: str, line: str) -> str:
    return f"{sign}{line}" if line.endswith("\n") else f"{sign}{line}\n{_NO_LINE_END}"
