"""Plots of a recording: joints, tool and clearance over time, with events marked."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robomesh.contract.topics import topic
from robomesh.extras import missing
from robomesh.recordings.reading import RecordingFile
from robomesh.recordings.series.downsampling import MOST_VALUES, Series, SeriesReader, known_values
from robomesh.recordings.series.publisher_time import PublisherTimes
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.terminal.local_time import time_text
from services.command_line.terminal.output import progress
from services.export.errors import ExportError
from services.export.span import Span, decoded, topics_of

COLORS = ("#1462a8", "#8a6a1f", "#2b7a4b", "#93456f", "#5a51a8", "#5b6369", "#9a5426")
_TEXT, _LINE = "#1d2124", "#cbd0d3"
_MARKS = {
    schema.Event.INFO: "#8b9398",
    schema.Event.WARNING: "#b37400",
    schema.Event.ERROR: "#b3261e",
    schema.Event.CRITICAL: "#b3261e",
}
_CLEARANCE = "clearance"
_POINTS = 2000
_MOST_EVENTS, _MOST_NAMED, _MOST_LABELS = 60, 12, 10
# Least range of the clearance axis, which starts at 0: a narrower one would magnify noise [mm].
_LEAST_CLEARANCE_MM = 50.0


class Panel(NamedTuple):
    """A plot: its title and the names of its values."""

    title: str
    values: tuple[str, ...]


class _Mark(NamedTuple):
    severity: schema.Event.Severity
    at_s: float
    code: str


def write_plots(file: RecordingFile, span: Span, target: Path) -> int:
    """Draw the plots as PNG, PDF or SVG; return their number.

    Raises:
        ExportError: If the recording has nothing to plot, or matplotlib is missing.
        RecordingError: If the file is damaged.
    """
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise ExportError(missing("matplotlib")) from None

    panels = panels_of(known_values(file))
    if not panels:
        raise ExportError(f"{file.path.name}: it holds no joints, tool or clearance to plot")
    reader, events = SeriesReader(), _events(file, span)
    with (
        mpl.rc_context(
            {"font.size": 8.5, "svg.hashsalt": "robomesh", "axes.edgecolor": _LINE, "text.color": _TEXT}
        ),
        progress("plots") as report,
    ):
        figure = Figure(
            figsize=(10, 2.1 * len(panels) + 1.0), dpi=130, facecolor="white", layout="constrained"
        )
        all_axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
        for number, (panel, axes) in enumerate(zip(panels, all_axes, strict=True)):
            drawn = panel.values[:MOST_VALUES]
            found = reader.read(file, drawn, start_ns=span.start_ns, end_ns=span.end_ns, points=_POINTS)
            _draw(axes, panel.title, found, between_s=1.5e-9 * (span.end_ns - span.start_ns) / _POINTS)
            if len(drawn) < len(panel.values):
                words = f"the first {len(drawn)} of {len(panel.values)}"
                axes.set_title(words, loc="right", fontsize=8, color=_MARKS[schema.Event.WARNING])
            _mark(axes, events, named=number == 0)
            report((number + 1) / len(panels))
        zero = file.layout.start_ns
        all_axes[-1].set_xlim((span.start_ns - zero) * 1e-9, (span.end_ns - zero) * 1e-9)
        all_axes[-1].set_xlabel("seconds since the recording's start")
        figure.suptitle(_title(file), x=0.01, ha="left", fontsize=10, fontweight="bold")
        figure.savefig(target, metadata={"Date": None} if target.suffix.lower() == ".svg" else None)
    return len(panels)


def panels_of(known: list[str]) -> list[Panel]:
    """Return the plots of a recording with these values; none is empty."""

    def ending(first: str, last: str) -> tuple[str, ...]:
        return tuple(name for name in known if name.startswith(first) and name.endswith(last))

    tool = tuple(
        name for name in ("kinematics/tool/x", "kinematics/tool/y", "kinematics/tool/z") if name in known
    )
    near = tuple(name for name in ("kinematics/clearance", "kinematics/own_clearance") if name in known)
    panels = (
        Panel("joints", ending("joints/", "/position")),
        Panel("joint speeds", ending("joints/", "/velocity")),
        Panel("tool, base frame", tool),
        Panel("tool speed", tuple(name for name in ("kinematics/tool/speed",) if name in known)),
        Panel(_CLEARANCE, near),
    )
    return [panel for panel in panels if panel.values]


def _draw(axes: Any, title: str, found: list[Series], *, between_s: float) -> None:
    """Draw the series of a panel; `between_s`: more than the time between two of their points."""
    unit, factor = _shown(found[0].unit)
    for number, each in enumerate(found):
        color = COLORS[number % len(COLORS)]
        # A line across a time without data would show values that nothing measured.
        longest_s = max(topic(each.name.split("/")[0]).stale_after_s or 0.0, between_s)
        gaps = np.flatnonzero(np.diff(each.times_s) > longest_s) + 1
        times_s, low, high = (
            np.insert(values, gaps, np.nan) for values in (each.times_s, each.lowest, each.highest)
        )
        low, high = low * factor, high * factor
        axes.plot(times_s, (low + high) / 2, color=color, linewidth=1.0, label=_label(each.name))
        # Fill from the lowest to the highest value of each point, so that no peak is lost.
        axes.fill_between(times_s, low, high, color=color, alpha=0.35, linewidth=0)
    if all(not len(each.times_s) or np.ptp(each.highest) == 0 for each in found):
        axes.margins(y=0.2)
    if title == _CLEARANCE:
        lowest, highest = axes.get_ylim()
        axes.set_ylim(min(lowest, 0.0), max(1.05 * highest, _LEAST_CLEARANCE_MM))
    axes.set_ylabel(f"{title} [{unit}]" if unit else title)
    axes.grid(color=_LINE, linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    handles, labels = axes.get_legend_handles_labels()
    cut = f"of {len(labels)} the first:" if len(labels) > _MOST_LABELS else None
    axes.legend(
        handles[:_MOST_LABELS],
        labels[:_MOST_LABELS],
        loc="center left",
        bbox_to_anchor=(1.0, 0.5),
        frameon=False,
        title=cut,
    )


def _label(name: str) -> str:
    """Return the part of a value's name that is unique in its plot."""
    parts = name.split("/")
    if parts[0] == "joints":
        return parts[1]
    return {"clearance": "to its surroundings", "own_clearance": "to itself"}.get(parts[-1], parts[-1])


def _shown(unit: str) -> tuple[str, float]:
    """Return the displayed unit and the factor to it: degrees and millimetres."""
    degrees = 180.0 / np.pi
    return {"rad": ("°", degrees), "rad/s": ("°/s", degrees), "m": ("mm", 1e3), "m/s": ("mm/s", 1e3)}.get(
        unit, (unit, 1.0)
    )


def _title(file: RecordingFile) -> str:
    """Return the title: robot, name and start of the recording."""
    about = file.layout.about
    robot = "/".join(about[name] for name in ("site", "robot") if about.get(name))
    return "   ".join(
        filter(None, (robot, about.get("name") or file.path.stem, time_text(file.layout.start_ns * 1e-9)))
    )


def _events(file: RecordingFile, span: Span) -> list[_Mark]:
    """Return the events in the span; of too many, the most severe."""
    topics = [key for name, key in topics_of(file).items() if name.split("/")[0] == "events"]
    marks, times = [], PublisherTimes()
    for message in file.messages(topics, start_ns=span.start_ns, end_ns=span.end_ns + 1):
        event = decoded(schema.Event, message.data)
        if event is not None and event.severity in _MARKS:
            at_s = (times.of(message) - file.layout.start_ns) * 1e-9
            marks.append(_Mark(event.severity, at_s, event.code))
    return sorted(marks, key=lambda mark: -mark.severity)[:_MOST_EVENTS]


def _mark(axes: Any, events: list[_Mark], *, named: bool) -> None:
    for number, event in enumerate(events):
        color = _MARKS[event.severity]
        axes.axvline(event.at_s, color=color, linewidth=0.9, alpha=0.8)
        if named and number < _MOST_NAMED:
            axes.annotate(
                event.code,
                (event.at_s, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(2, -2),
                textcoords="offset points",
                rotation=90,
                va="top",
                fontsize=6.5,
                color=color,
            )
