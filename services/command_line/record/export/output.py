"""Files that appear complete or not at all."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from services.export.errors import ExportError


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
