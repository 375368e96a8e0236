"""`robomesh recordings export`: a recording as a table, video, plots or for Rerun, by the file's ending."""

from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from robomesh.recordings.reading import RecordingFile
from services.command_line.record.export.output import atomic_file
from services.command_line.terminal.output import print_json, print_line, progress
from services.export.errors import ExportError
from services.export.span import Span, span_of

_PLOTS = (".png", ".pdf", ".svg")


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """The requested part of a recording, and options of its video.

    Attributes:
        begin_s: Since the recording's start.
        end_s: Since the recording's start; None: to its end.
        view: View to render.
        size: Video size [px].
        samples: Anti-aliasing samples.
        recorded: View whose recorded video is copied; empty: render `view`.
    """

    begin_s: float = 0.0
    end_s: float | None = None
    view: str = "free"
    size: tuple[int, int] = (1280, 720)
    fps: float = 30.0
    samples: int = 4
    recorded: str = ""


def run(source: AbstractContextManager[Path], out: Path, wanted: ExportOptions, as_json: bool) -> None:
    """Export a recording.

    Args:
        source: Yields its file; entered once `out` is known to have a valid name.

    Raises:
        ExportError: If the recording cannot be exported as requested.
        RecordingError: If the recording cannot be read.
    """
    kind = out.suffix.lower()
    if kind not in (".csv", ".mp4", ".rrd", *_PLOTS):
        raise ExportError(
            f"{out}: the name must end in .csv (joints and tool), .mp4 (video), .rrd (Rerun), "
            f"{', '.join(_PLOTS)} (plots)"
        )
    with source as path, RecordingFile(path) as file:
        span = span_of(file, wanted.begin_s, wanted.end_s)
        with atomic_file(out) as partial:
            words, values = _write(file, span, partial, kind, wanted)
    if as_json:
        print_json({"file": str(out), "bytes": out.stat().st_size, **values})
    else:
        print_line(f"{out}: {words}, {out.stat().st_size / 1e6:.2f} MB")


def _write(
    file: RecordingFile, span: Span, target: Path, kind: str, wanted: ExportOptions
) -> tuple[str, Mapping[str, float]]:
    if kind == ".csv":
        from services.command_line.record.export.tables import write_table

        rows = write_table(file, span, target)
        return f"{rows} states", {"rows": rows}
    if kind in _PLOTS:
        from services.command_line.record.export.plots import write_plots

        panels = write_plots(file, span, target)
        return f"{panels} plots", {"plots": panels}
    if kind == ".rrd":
        from services.command_line.record.export.rerun_file import write_rerun

        counts = write_rerun(file, span, target)
        return ", ".join(f"{number} {what}" for what, number in counts.items()), dict(counts)
    if wanted.recorded:
        from services.command_line.record.export.recorded_video import write_recorded

        pictures, duration_s = write_recorded(file, span, target, wanted.recorded)
    else:
        from services.export.rendered_video import Rendering, write_rendered

        rendering = Rendering(view=wanted.view, size=wanted.size, fps=wanted.fps, samples=wanted.samples)
        with progress("video") as report:
            pictures, duration_s = write_rendered(file, span, target, rendering, on_progress=report)
    return f"{pictures} pictures, {duration_s:.1f} s", {"pictures": pictures, "duration_s": duration_s}
