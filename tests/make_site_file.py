"""Write docs/reference/site-file.md from the models: `./dev run python tests/make_site_file.py`."""

import inspect
import re
import sys
from collections.abc import Iterator
from datetime import date
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

import annotated_types
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from robomesh.contract import quotas
from robots.schema.robot_toml import Pose
from services.site_file.site import Site
from services.site_file.tables.quotas import Quotas

FILE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "site-file.md"

_HEAD = """# Site file

Generated from the models in `services/site_file/tables/` and `controllers/*/table.py` by
`tests/make_site_file.py`; do not edit.

`robomesh up site.toml` starts the services of a site file. Without a file it starts the site `demo`. An
unknown key is an error. Lengths are in millimetres and angles in degrees. A path is relative to the site
file's folder. The default "absent" means that the key has no value unless the file gives one.
"""
# The settings that a service gets have the descriptions of these keys.
_DESCRIBED_BY: dict[type[BaseModel], type] = {Quotas: quotas.Quotas}
# A robot's description may choose other units for its poses; a site file does not.
_UNITS: dict[tuple[type[BaseModel], str], str] = {(Pose, "xyz"): "mm", (Pose, "rpy"): "deg"}
_UNIT = re.compile(r" \[([A-Za-z/]+)\]")
_TYPES = {
    str: "text",
    Path: "path",
    bool: "true or false",
    int: "whole number",
    float: "number",
    date: "date",
}
_BOUNDS = (
    (annotated_types.Ge, "ge", "at least"),
    (annotated_types.Gt, "gt", "above"),
    (annotated_types.Le, "le", "at most"),
)


def descriptions(model: type) -> dict[str, str]:
    """Return the text of each key, from `Attributes` of the docstrings of a model and its bases."""
    found: dict[str, str] = {}
    for each in reversed(model.__mro__):
        section = inspect.cleandoc(each.__doc__ or "").partition("Attributes:\n")[2].partition("\n\n")[0]
        for name, text in re.findall(r"^ {4}(\w+): (.*(?:\n {8}.*)*)", section, re.MULTILINE):
            found[name] = " ".join(text.split())
    return found


def plain(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a type without `None`, and its constraints."""
    constraints: tuple[Any, ...] = ()
    if get_origin(annotation) is Annotated:
        annotation, *found = get_args(annotation)
        for each in found:
            constraints += tuple(each.metadata) if isinstance(each, FieldInfo) else (each,)
    several = [each for each in get_args(annotation) if each is not NoneType]
    if NoneType in get_args(annotation) and len(several) == 1:
        inner, more = plain(several[0])
        return inner, constraints + more
    return annotation, constraints


def table_of(annotation: Any) -> type[BaseModel] | None:
    """Return the table that a key holds, directly or in a list; None: it holds a value."""
    inner, _ = plain(annotation)
    if get_origin(inner) is tuple:
        inner, _ = plain(get_args(inner)[0])
    for each in get_args(inner) if get_origin(inner) is Union else ():
        inner = each if isinstance(each, type) and issubclass(each, BaseModel) else inner
    return inner if isinstance(inner, type) and issubclass(inner, BaseModel) else None


def type_text(annotation: Any, constraints: tuple[Any, ...] = ()) -> str:
    """Return a type in words, with its range."""
    inner, more = plain(annotation)
    constraints += more
    if get_origin(inner) is Literal:
        *most, last = map(value, get_args(inner))
        return f"{', '.join(most)} or {last}"
    if get_origin(inner) is tuple:
        first, *rest = get_args(inner)
        count = "list" if rest == [...] else f"list of {len(rest) + 1}"
        return f"{count}, each {type_text(first)}"
    if get_origin(inner) is dict:
        return "table of a number and a text"
    if isinstance(inner, type) and issubclass(inner, Enum):
        *most, last = (value(each.value) for each in inner)
        return f"{', '.join(most)} or {last}"
    words = [_TYPES[inner]]
    for kind, name, text in _BOUNDS:
        words += [f"{text} {getattr(each, name):.15g}" for each in constraints if isinstance(each, kind)]
    return ", ".join(words)


def value(given: Any) -> str:
    """Return a value as TOML, in code."""
    if isinstance(given, tuple | list):
        return f"`[{', '.join(value(each).strip('`') for each in given)}]`"
    if isinstance(given, bool):
        return f"`{str(given).lower()}`"
    if isinstance(given, str | Path):
        return f'`"{given}"`'
    return f"`{given:.15g}`"


def default_text(field: FieldInfo) -> str:
    """Return a key's default."""
    given = field.get_default(call_default_factory=True)
    if given is PydanticUndefined:
        return "required"
    if given is None:
        return "absent"
    if isinstance(given, BaseModel):
        return "its defaults"
    return value(given) if given or isinstance(given, bool | int | float) else "empty"


def rows(model: type[BaseModel], path: str, anchors: dict[type[BaseModel], str]) -> Iterator[str]:
    """Yield the rows of a table's keys; `anchors` has the headings of the tables in it."""
    texts = descriptions(_DESCRIBED_BY.get(model, model))
    yield "| key | type | unit | default | meaning |"
    yield "|" + "---|" * 5
    for name, field in model.model_fields.items():
        table, text = table_of(field.annotation), texts[name]
        if not path and table is not None:
            continue
        kind = type_text(field.annotation, tuple(field.metadata)) if table is None else ""
        if table is not None:
            of = get_origin(plain(field.annotation)[0])
            several = "list of tables" if of is tuple else "true, false or table" if of is Union else "table"
            kind = f"[{several}](#{anchors[table].replace('.', '')})"
        unit = _UNIT.search(text)
        shown = unit.group(1) if unit else _UNITS.get((model, name), "")
        meaning = _UNIT.sub("", text, count=1).replace("|", "\\|")
        yield f"| `{name}` | {kind} | {shown} | {default_text(field)} | {meaning} |"


def sections(model: type[BaseModel], path: str, anchors: dict[type[BaseModel], str]) -> Iterator[str]:
    """Yield the lines of a table, then those of the tables in it that no table before it has."""
    within = {
        name: (table, field)
        for name, field in model.model_fields.items()
        if (table := table_of(field.annotation)) is not None and table not in anchors
    }
    for name, (table, _) in within.items():
        anchors[table] = f"{path}.{name}" if path else name
    yield from (*rows(model, path, anchors), "")
    for name, (table, field) in within.items():
        several = get_origin(plain(field.annotation)[0]) is tuple
        title = f"{path}.{name}" if path else f"[[{name}]]" if several else f"[{name}]"
        intro = inspect.cleandoc(table.__doc__ or "").split("\n\n")[0]
        yield from (f"{'###' if path else '##'} `{title}`", "", intro, "")
        yield from sections(table, anchors[table], anchors)


def document() -> str:
    """Return the text of docs/reference/site-file.md.

    Raises:
        KeyError: If `Attributes` of a model's docstring lacks a key.
    """
    return "\n".join([_HEAD, *sections(Site, "", {})])


if __name__ == "__main__":
    FILE.write_text(document(), encoding="utf-8")
