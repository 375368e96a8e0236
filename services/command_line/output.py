"""Standard output and error of a command, with direction characters of foreign texts made visible."""

import io
import os
import sys
from typing import IO

from robomesh.texts import show_direction


class _VisibleDirections(io.TextIOWrapper):
    """A stream that prints direction characters (U+202E, ...) as their code points."""

    def write(self, text: str, /) -> int:
        super().write(show_direction(text))
        return len(text)


def print_or_discard(text: str, stream: IO[str]) -> None:
    """Print a line, for a command that must go on when the reader of its output is gone."""
    try:
        print(text, file=stream, flush=True)
    except BrokenPipeError:
        discard(stream)


def discard(stream: IO[str]) -> None:
    """Send the rest of a stream to /dev/null."""
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, stream.fileno())
    os.close(nothing)


def show_directions() -> None:
    """Replace standard output and error, so that foreign text cannot reorder the output.

    Bytes written to the underlying buffer are not changed.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        # Keep a stream of another type: a test's own.
        if type(stream) is io.TextIOWrapper:
            line_buffering, encoding, errors = stream.line_buffering, stream.encoding, stream.errors
            visible = _VisibleDirections(
                stream.detach(),
                encoding=encoding,
                errors=errors,
                line_buffering=line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, visible)
