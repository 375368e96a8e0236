"""The command line of the programs of this folder.

A program is a module with a function `measure`. Its parameters are the options, its docstring's first
paragraphs are the help, and its result is printed as JSON with `--json`, else as text, by the module's
`show` if it has one. A generator prints each of its results as soon as it has it.

pyperf and asv repeat one function of one process and keep its time. These programs measure delays, losses,
memory and processor time of many processes, in one run with their peers, so neither fits.
"""

import ast
import asyncio
import importlib
import inspect
import json
import os
import re
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import typer

from benchmarks.harness.tables import lines_of

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "benchmarks"


def programs() -> dict[str, Path]:
    """Return the files of the programs, by name."""
    defines = re.compile(r"^(?:async )?def measure\(", re.MULTILINE)
    return {file.stem: file for file in sorted(FOLDER.rglob("*.py")) if defines.search(file.read_text())}


def main(words: list[str]) -> None:
    """Run the program that the first word names, with the options that follow it."""
    files = programs()
    if not words or words[0] not in files:
        for name, file in files.items():
            doc = ast.get_docstring(ast.parse(file.read_text())) or ""
            print(f"{name:16} {doc.splitlines()[0]}")
        sys.exit(2 if words and words[0] not in ("-h", "--help") else 0)
    file = files[words[0]]
    module = importlib.import_module(".".join(file.relative_to(ROOT).with_suffix("").parts))
    run(module, words)


def run(module: ModuleType, words: list[str]) -> None:
    """Measure, and print the result."""
    machine = {"cores": os.cpu_count(), "load": os.getloadavg()[0]}

    def printed(*, as_json: bool, **options: Any) -> None:
        found = module.measure(**options)
        if inspect.iscoroutine(found):
            found = asyncio.run(found)
        for result in found if inspect.isgenerator(found) else (found,):
            if isinstance(result, dict):
                result = {**machine, **result}
            if as_json:
                print(json.dumps(result), flush=True)
            elif hasattr(module, "show"):
                module.show(result)
            else:
                print("\n".join(lines_of(result)), flush=True)

    options = inspect.signature(module.measure).parameters.values()
    as_json = Annotated[bool, typer.Option("--json", help="print the result as JSON")]
    more = inspect.Parameter("as_json", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=as_json)
    printed.__signature__ = inspect.Signature([*options, more])  # type: ignore[attr-defined]
    app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
    # Keep the lines of each paragraph.
    app.command(help="\b\n" + (module.__doc__ or "").replace("\n\n", "\n\n\b\n"))(printed)
    app(words[1:], prog_name=f"python -m benchmarks {words[0]}")


def say(text: str) -> None:
    """Print a line about the progress, on standard error."""
    print(text, file=sys.stderr, flush=True)


def chosen(option: str, text: str, known: Iterable[str]) -> list[str]:
    """Return the names of an option, which are separated by commas.

    Raises:
        typer.BadParameter: If a name is unknown.
    """
    names = [name for name in text.split(",") if name]
    if unknown := [name for name in names if name not in known]:
        raise typer.BadParameter(f"{option} {', '.join(unknown)}: choose from {', '.join(known)}")
    return names
