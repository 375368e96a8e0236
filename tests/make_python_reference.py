"""Write docs/reference/python.md from the package: `./dev run python tests/make_python_reference.py`."""

import ast
import inspect
import re
import sys
import textwrap
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

import robomesh
from robomesh.contract.endpoints import DEFAULT_ROUTER

FILE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "python.md"

_HEAD = """# `import robomesh`

Generated from the package by `tests/make_python_reference.py`; do not edit. The guide is
[../python.md](../python.md). A change here is a change for every program that uses the package.
"""
_SECTIONS = {
    "Connections": ("connect", "connect_async", "Service"),
    "Robots and control": ("Robot", "Arm", "CommandResult", "JogResult", "StopResult"),
    "Kinematics": ("CheckResult", "Violation", "InverseResult"),
    "Streams": ("Stream", "JointState", "SignalState", "Sample", "Event", "Alarm", "Note"),
    "Recordings": (
        "open_recording",
        "Recording",
        "RecordingInfo",
        "RecordedTopic",
        "RecordedJoints",
        "RecordedValues",
        "RecordedSample",
    ),
    "Errors": (),  # all of them
    "Asynchronous forms": ("AsyncRobot", "AsyncArm", "AsyncStream", "AsyncRecording"),
}
# Classes with these names are created by the functions.
_ALSO = {"connect": "Mesh", "connect_async": "AsyncMesh"}
# For the synchronous forms.
INTERNAL = {"blocking", "leave", "prepare", "sample_pages"}
_ALIASES = {"DEFAULT_ROUTER": repr(DEFAULT_ROUTER), "OnStale": "Literal['raise', 'yield']", "schema.": ""}


def document() -> str:
    """Return the text of docs/reference/python.md."""
    errors = [name for name in robomesh.__all__ if name.endswith("Error")]
    lines = [_HEAD]
    for title, names in _SECTIONS.items():
        lines += [f"## {title}", ""]
        for name in names or errors:
            lines += [*_described(name), ""]
    return "\n".join(lines)


def missing() -> set[str]:
    """Return public names that are in no section."""
    there = {name for names in _SECTIONS.values() for name in names} | set(_ALSO.values())
    return {name for name in robomesh.__all__ if name not in there and not name.endswith("Error")}


def _described(name: str) -> Iterator[str]:
    thing = getattr(robomesh, name)
    yield f"### `{name}`" + (f": class `{_ALSO[name]}`" if name in _ALSO else "")
    yield ""
    if not inspect.isclass(thing):
        yield f"`{name}{_signature(thing)}`: {_summary(thing)}"
        return
    base = thing.__mro__[1]
    based = f" Base: `{base.__name__}`." if base.__name__ in robomesh.__all__ else ""
    yield f"{_summary(thing)}{based}"
    yield ""
    if name in _ALSO:
        yield f"- `{name}{_signature(thing.__init__)}`"
    for own in reversed(thing.__mro__):
        # Members of a public base are in its own section.
        if own is thing or own.__name__ == "_Recorded":
            yield from (f"- {line}" for line in _members(own))


def _members(thing: type) -> Iterator[str]:
    """Yield a line for each attribute that the docstring or an annotation names, and each function."""
    annotated = {
        each.target.id: _plain(each.annotation)
        for each in _tree(thing).body
        if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
    }
    described = list(_attributes(thing))
    told = {name for names, _ in described for name in names}
    for names, text in [*(([name], "") for name in annotated if name not in told), *described]:
        typed = ", ".join(f"`{name}{_colon(annotated.get(name))}`" for name in names)
        yield f"{typed}{_colon(text)}"
    for name, member in vars(thing).items():
        if name.startswith("_") or name in annotated or name in INTERNAL:
            continue
        if isinstance(member, property | cached_property):
            function = member.fget if isinstance(member, property) else member.func
            yield f"`{name}: {_plain(_tree(function).returns)}`: {_summary(function)}"
        elif inspect.isfunction(member):
            begun = "await " if inspect.iscoroutinefunction(member) else ""
            yield f"`{begun}{name}{_signature(member)}`: {_summary(member)}"


def _colon(text: str | None) -> str:
    return f": {text}" if text else ""


def _attributes(thing: type) -> Iterator[tuple[list[str], str]]:
    """Yield names and text of each entry below "Attributes:" of a docstring."""
    _, _, section = (thing.__doc__ or "").partition("Attributes:\n")
    section = textwrap.dedent(section.partition("\n\n")[0])
    for entry in re.split(r"\n(?=\S)", section.strip()):
        names, _, text = entry.partition(": ")
        if text:
            yield names.split(", "), " ".join(text.split())


def _signature(function: Any) -> str:
    tree = _tree(function)
    tree.args.args = [each for each in tree.args.args if each.arg != "self"]
    returns = _plain(tree.returns)
    if not inspect.iscoroutinefunction(function) and hasattr(function, "__wrapped__"):
        returns = returns.replace("AsyncStream", "Stream")  # the blocking form
    return f"({_plain(tree.args)})" + ("" if returns in ("None", "") else f" -> {returns}")


def _tree(thing: Any) -> Any:
    """Return the syntax tree of a class or function."""
    return ast.parse(textwrap.dedent(inspect.getsource(thing))).body[0]


def _plain(tree: ast.AST | None) -> str:
    """Return the source of an annotation or of parameters."""
    text = "" if tree is None else re.sub("(?<! )=(?! )", " = ", ast.unparse(tree))
    for alias, meaning in _ALIASES.items():
        text = text.replace(alias, meaning)
    return re.sub(r"^'(.*)'$", r"\1", text)


def _summary(thing: Any) -> str:
    return (inspect.getdoc(thing) or "").partition("\n")[0]


if __name__ == "__main__":
    FILE.write_text(document(), encoding="utf-8")
