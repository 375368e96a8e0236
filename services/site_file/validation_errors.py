"""Problems of a site file as sentences."""

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel

from protocol_gateway.seam.table import problem_text


def sentence(path: Path, problem: Any, values: dict[str, Any], model: type[BaseModel]) -> str:
    """Return one of pydantic's problems as one line: file, key, value and what would be right.

    Args:
        model: Model of the whole file.
    """
    kind, place, given = problem["type"], problem["loc"], problem["input"]
    parts = list(place)
    if len(parts) > 1 and isinstance(parts[1], int):
        row = values[parts[0]][parts[1]]
        parts[1] = row.get("name", parts[1] + 1) if isinstance(row, dict) else parts[1] + 1
    where = ".".join(map(str, parts))
    if kind == "missing":
        return f"{path}: {where} is missing"
    if kind == "extra_forbidden":
        keys = _keys(model, place[:-1])
        near = get_close_matches(str(parts[-1]), keys, n=1)
        # All keys are listed where there are few.
        hint = (
            f": is {near[0]} meant?" if near else f": there are {', '.join(keys)}" if len(parts) > 1 else ""
        )
        return f"{path}: {where} is not a key that a site file has{hint}"
    message = problem_text(problem)
    if kind == "string_type":
        message = f'should be text in quotes, as in "{given}"'
    elif kind == "tuple_type" and isinstance(given, dict):
        message = f"there may be several: write [[{where}]], with two brackets"
    elif kind == "tuple_type":
        message = "should be a list, as in [1, 2]"
    elif kind == "model_type" and isinstance(given, list):
        message = f"there is one: write [{where}], with one bracket"
    # The value of a whole table is too long to help; the sentence names the wrong key in it.
    if not where or (given and isinstance(given, dict | list | tuple)):
        return f"{path}: {where + ': ' if where else ''}{message}"
    return f"{path}: {where} = {given!r}: {message}"


def _keys(model: type[BaseModel], place: Sequence[str | int]) -> list[str]:
    """Return the keys of the table at a place."""
    for part in place:
        if isinstance(part, str) and part in model.model_fields:
            model = next(_tables(model.model_fields[part].annotation), model)
    return list(model.model_fields)


def _tables(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _tables(part)
