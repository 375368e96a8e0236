"""Files that are there whole or not at all, and how far their making is."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from services.command_line.recordings.errors import ExportError


@contextlib.contextmanager
def whole_file(out: Path) -> Iterator[Path]:
    """A file beside `out` to be written; it takes its name at the end, and is gone if that never comes.

    Raises:
        ExportError: If it cannot be written there.
    """
    # The ending stays: it tells some writers what to write.
    partial = out.with_name(f".{out.stem}.part{out.suffix}")
    try:
        yield partial
        partial.replace(out)
    except OSError as error:
        raise ExportError(f"{out}: cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)


@contextlib.contextmanager
def progress(what: str) -> Iterator[Callable[[float], None]]:
    """Shows how far it is, from 0 to 1, where somebody looks: on a terminal."""
    if not sys.stderr.isatty():
        yield lambda share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn(what), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)
