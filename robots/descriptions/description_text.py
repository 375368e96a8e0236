"""Writer of robot.toml text, in the order and form of a hand-written file.

One table per object, an inline table per pose, one line per value. Comments of the replaced file stay.
"""

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Table

from robots.schema.bounded_toml import check_bounds

_VALUES = ("name", "title", "title_zh", "provenance", "provenance_zh", "units", "urdf", "packages")
# Written as [table]; every other table is written inline.
_TABLES = ("base", "tool", "collision")
_ARRAYS = ("joint", "link", "frame", "constraint")
_ORDER = (*_VALUES, "base", "joint", "link", "tool", "frame", "constraint", "view", "collision")
_LONGEST_LINE = 110


def description_text(values: Mapping[str, Any], before: str = "") -> str:
    """Return the text of a robot.toml.

    Args:
        values: By the file's key names; None values are left out, numbers become floats.
        before: The text to replace; its comments and order are kept where they still apply.
    """
    wanted = as_saved(values)
    new_text = _new_text(wanted)
    if not before:
        return new_text
    try:
        check_bounds(before)
        document = tomlkit.parse(before)
        _merge(document, tomlkit.parse(new_text))
        merged = tomlkit.dumps(document)
        # If the merge with the old text changed a value, write the text without the old comments.
        return merged if tomllib.loads(merged) == wanted else new_text
    except (TOMLKitError, tomllib.TOMLDecodeError):
        return new_text


def as_saved(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values as a saved description gives them back: without None, numbers as floats."""
    known = [key for key in _ORDER if key in values]
    # TOML needs plain values before tables. Unknown keys come last; the description's check rejects them.
    return _floats({key: values[key] for key in [*known, *(set(values) - set(known))]})  # type: ignore[no-any-return]


def _floats(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _floats(each) for key, each in value.items() if each is not None}
    if isinstance(value, list | tuple):
        return [_floats(each) for each in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _new_text(values: Mapping[str, Any]) -> str:
    blocks: list[list[str]] = [[]]
    for key, value in values.items():
        if key in _TABLES and isinstance(value, dict):
            blocks.append([f"[{key}]", *_lines(value)])
        elif key == "view" and isinstance(value, dict):
            blocks += [[f"[view.{_key(name)}]", *_lines(view)] for name, view in value.items()]
        elif key in _ARRAYS and isinstance(value, list):
            blocks += [[f"[[{key}]]", *_lines(row)] for row in value]
        else:
            blocks[0] += _lines({key: value})
    return "\n".join("\n".join(block) + "\n" for block in blocks if block)


def _lines(table: Mapping[str, Any]) -> Iterable[str]:
    for key, value in table.items():
        line = f"{_key(key)} = {inline_text(value)}"
        if len(line) > _LONGEST_LINE and isinstance(value, list):
            line = f"{_key(key)} = [\n" + "".join(f"  {inline_text(each)},\n" for each in value) + "]"
        yield line


def inline_text(value: Any) -> str:
    """Return a value in TOML, a table in one line."""
    if isinstance(value, dict):
        inside = ", ".join(f"{_key(key)} = {inline_text(each)}" for key, each in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, list):
        return f"[{', '.join(map(inline_text, value))}]"
    return str(tomlkit.item(value).as_string())


def _key(name: str) -> str:
    return str(tomlkit.key(name).as_string())


def _merge(old: Any, new: Any) -> None:
    """Update a parsed table to equal another; leave equal items untouched."""
    for key in [key for key in old if key not in new]:
        del old[key]
    for key, value in new.items():
        before = old.get(key)
        if before is None:
            old.append(key, value)
        elif isinstance(value, AoT) and isinstance(before, AoT):
            _merge_rows(before, value)
        elif isinstance(value, Table) and isinstance(before, Table):
            _merge(before, value)
        elif before.unwrap() != value.unwrap():
            old[key] = value


def _merge_rows(old: AoT, new: AoT) -> None:
    """Merge [[joint]] rows by name and [[constraint]] rows by index; a row that moves keeps its comments."""
    named = {row["name"]: row for row in old if "name" in row}
    rows = []
    for number, row in enumerate(new):
        kept = named.get(row["name"]) if "name" in row else old[number] if number < len(old) else None
        if kept is not None:
            _merge(kept, row)
        rows.append(row if kept is None else kept)
    del old[:]
    for row in rows:
        old.append(row)
