"""Worker process that renders a part of a recording as MP4, run with `python -m`.

The console runs it, by this name, and kills it when its caller cancels.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from robomesh.files.worker import answer_all, report
from robomesh.recordings.reading import RecordingFile
from services.export.rendered_video import Rendering, write_rendered
from services.export.span import span_of

_STEP = 0.01


def render(question: tuple[str, str, float, float | None, dict[str, Any]]) -> tuple[int, float]:
    """Render `recording, target, begin_s, end_s, rendering`; return pictures and seconds."""
    recording, target, begin_s, end_s, rendering = question
    with RecordingFile(Path(recording)) as file:
        span = span_of(file, begin_s, end_s)
        return write_rendered(file, span, Path(target), Rendering(**rendering), on_progress=_in_steps())


def _in_steps() -> Callable[[float], None]:
    reported = -1.0

    def on_progress(share: float) -> None:
        nonlocal reported
        if share - reported >= _STEP or share >= 1.0:
            reported = share
            report(share)

    return on_progress


if __name__ == "__main__":
    answer_all(lambda _: render)
