"""Files that appear complete or not at all, and a progress bar."""

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

from services.command_line.recordings.errors import ExportError


@contextlib.contextmanager
def atomic_file(out: Path) -> Iterator[Path]:
    """Yield a temporary path next to `out`; the block's end renames it, an error removes it.

    Raises:
        ExportError: If the file cannot be written.
    """
    # Keep the ending, from which some writers choose the format.
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
    """Show a progress bar on a terminal; yield a function that sets it, from 0 to 1."""
    if not sys.stderr.isatty():
        yield lambda share: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = (TextColumn(what), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)
        yield lambda share: bar.update(task, completed=share)
