"""The one way from a command to a terminal: lines, texts, JSON and styled tables.

What a command prints holds texts of every publisher and file. Only this module writes them; ruff refuses
`print`, `typer.echo` and a rich console elsewhere in this package. Standard output and error are replaced too
(`protect`), for what other libraries print.
"""

import contextlib
import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from typing import IO, TYPE_CHECKING, Any, cast

from robomesh.texts import for_terminal

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


class _Protected(io.TextIOWrapper):
    """A stream that writes no character that a terminal interprets, except line ends and tabs."""

    def write(self, text: str, /) -> int:
        self.write_styled(for_terminal(text))
        return len(text)

    def write_styled(self, text: str) -> None:
        """Write a text of this module with its styles."""
        super().write(text)


def protect() -> None:
    """Replace standard output and error; bytes written to the underlying buffer are not changed."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        # Keep a stream of another type: a test's own.
        if type(stream) is io.TextIOWrapper:
            line_buffering, encoding, errors = stream.line_buffering, stream.encoding, stream.errors
            protected = _Protected(
                stream.detach(),
                encoding=encoding,
                errors=errors,
                line_buffering=line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, protected)


def discard(stream: IO[str]) -> None:
    """Send the rest of a stream to /dev/null."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, stream.fileno())
    os.close(nothing)


def print_line(text: object, *, err: bool = False, lasting: bool = False, red: bool = False) -> None:
    """Print one line; a line end within it is shown by its number.

    Args:
        text: The line.
        err: Print to standard error.
        lasting: Go on when the reader of standard output is gone; that of standard error is never missed.
        red: Print in red on a terminal.
    """
    _write(for_terminal(str(text), keep=""), sys.stderr if err else sys.stdout, err or lasting, red)


def print_text(text: str, *, err: bool = False) -> None:
    """Print lines that may begin and end where their author says: a program, a note, help."""
    if text:
        lines = for_terminal(text.replace("\r\n", "\n")).removesuffix("\n")
        _write(lines, sys.stderr if err else sys.stdout, err)


def print_json(value: Any) -> None:
    """Print a value as one line of JSON."""
    print_line(json_line(value))


def json_line(value: Any) -> str:
    """Return a value as one line of exact JSON; numbers that JSON lacks are strings, as in protobuf's JSON.

    Characters that a terminal interprets or hides are escaped.
    """
    try:
        text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    except ValueError:
        text = json.dumps(_finite(value), ensure_ascii=False, allow_nan=False)
    return text if text.isprintable() else "".join(map(_escaped, text))


def styled_line(parts: Iterable[tuple[str, str]]) -> "Text":
    """Return texts, each with its style, as one line for a console."""
    from rich.text import Text

    return Text("   ").join(styled(*each) for each in parts)


def styled(text: str, style: str = "") -> "Text":
    """Return one line in a style, for a console."""
    from rich.text import Text

    return Text(for_terminal(text, keep=""), style=style)


def console(*, err: bool = False) -> "Console":
    """Return a console for tables and displays of plain strings, which are no markup, and `styled` lines."""
    from rich.console import Console

    class OneLines(Console):
        """A console that shows a plain string as one line."""

        def render_str(self, text: str, *, style: Any = "", **_: Any) -> "Text":
            return styled(text, style)

    return OneLines(file=cast("IO[str]", _Styled(sys.stderr if err else sys.stdout)))


@contextlib.contextmanager
def progress(what: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar on a terminal; yield a function that sets it, from 0 to 1."""
    if not sys.stderr.isatty():
        yield lambda share: None
        return
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console(err=True), transient=True) as bar:
        task = bar.add_task(for_terminal(what, keep=""), total=1.0)
        yield lambda share: bar.update(task, completed=share)


class _Styled:
    """A stream for a console, which writes its own styles."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.write = getattr(stream, "write_styled", stream.write)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _write(text: str, stream: IO[str], lasting: bool, red: bool = False) -> None:
    if red and stream.isatty():
        text = f"\x1b[31m{text}\x1b[0m"
    try:
        _Styled(stream).write(f"{text}\n")
        stream.flush()
    except BrokenPipeError:
        if not lasting:
            raise
        discard(stream)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return value


def _escaped(character: str) -> str:
    return character if character.isprintable() else json.dumps(character)[1:-1]
