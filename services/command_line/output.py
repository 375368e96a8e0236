"""Standard output and error of a command: texts of others cannot reorder what is printed beside them."""

import io
import sys

from robomesh.texts import show_direction


class _Shown(io.TextIOWrapper):
    """A stream that shows control characters of direction by their numbers."""

    def write(self, text: str, /) -> int:
        super().write(show_direction(text))
        return len(text)


def show_directions() -> None:
    """Let everything that is printed from now on go through it; bytes are left as they are."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        # A test's own stream is another kind, and stays.
        if type(stream) is io.TextIOWrapper:
            line_buffering, encoding, errors = stream.line_buffering, stream.encoding, stream.errors
            shown = _Shown(
                stream.detach(),
                encoding=encoding,
                errors=errors,
                line_buffering=line_buffering,
                write_through=stream.write_through,
            )
            setattr(sys, name, shown)
