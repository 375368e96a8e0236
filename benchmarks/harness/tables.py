"""Results as text: nested names, and a table of rows where several results have the same names."""

from collections.abc import Iterator
from typing import Any

WIDE = 12


def lines_of(result: Any, indent: str = "") -> Iterator[str]:
    """Yield the lines of a result; numbers have four digits."""
    if isinstance(result, dict):
        if rows := rows_of(result):
            yield from table(rows, indent)
            return
        for name, value in result.items():
            if isinstance(value, dict) or is_rows(value):
                yield f"{indent}{name}:"
                yield from lines_of(value, f"{indent}  ")
            else:
                yield f"{indent}{name}: {word(value)}"
    elif is_rows(result):
        yield from table([flat(row) for row in result], indent)
    else:
        yield f"{indent}{word(result)}"


def rows_of(result: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the entries as rows, if they are two or more with the same names of plain values."""
    rows = [{"": name, **value} for name, value in result.items() if isinstance(value, dict)]
    plain = all(not isinstance(each, dict) and not is_rows(each) for row in rows for each in row.values())
    same = len(rows) == len(result) > 1 and len({tuple(row) for row in rows}) == 1
    return rows if plain and same else []


def is_rows(value: Any) -> bool:
    """Return whether a value is a list of rows."""
    return isinstance(value, list) and bool(value) and all(isinstance(each, dict) for each in value)


def flat(row: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return a row with one name for each nested value, such as `ours.p50`."""
    found: dict[str, Any] = {}
    for name, value in row.items():
        found |= flat(value, f"{prefix}{name}.") if isinstance(value, dict) else {f"{prefix}{name}": value}
    return found


def table(rows: list[dict[str, Any]], indent: str = "") -> Iterator[str]:
    """Yield the lines of a table with a column for each name, or for each row where the names are many."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    cells = [names, *([word(row.get(name, "")) for name in names] for row in rows)]
    if len(names) > WIDE:
        cells = [list(column) for column in zip(*cells, strict=True)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells:
        yield indent + "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()


def word(value: Any) -> str:
    """Return a plain value as text."""
    if isinstance(value, list | tuple):
        return " ".join(map(word, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)
