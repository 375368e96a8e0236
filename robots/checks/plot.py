"""Plot of a check: joints, tool speed and clearance over time, with violations marked."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robomesh.extras import missing
from robots.kinematics.joints import FloatArray, Joints, JointType
from robots.programs.steps import CheckReport, Violation, ViolationKind
from robots.schema.errors import SaveError

FORMATS = (".png", ".svg")

# The page's colours of the light theme, because plots are printed too.
_TEXT, _DIM, _LINE = "#1d2124", "#525a60", "#cbd0d3"
_CURVES = ("#1462a8", "#8a6a1f", "#2b7a4b", "#93456f", "#5a51a8", "#5b6369", "#9a5426")
_ALARM, _WARNING = "#b3261e", "#b37400"
# Samples per curve; more would fall on the same pixels.
_DRAWN = 4_000
_MOST_BANDS = 40
_MOST_LINE_NUMBERS = 24


def plot_check(result: CheckReport, joints: Joints, target: Path, *, title: str) -> None:
    """Draw a check's motion over time as PNG or SVG.

    Args:
        title: The program and the robot.

    Raises:
        SaveError: If the file has another suffix or cannot be written.
    """
    if target.suffix.lower() not in FORMATS:
        raise SaveError(target, f"a picture's name must end in {' or '.join(FORMATS)}")
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise SaveError(target, missing("matplotlib")) from None

    with mpl.rc_context(
        {"font.size": 8.5, "svg.hashsalt": "robomesh", "axes.edgecolor": _LINE, "text.color": _TEXT}
    ):
        around = bool(np.isfinite(result.path.clearances).any())
        heights = [2.2, 1.0, 1.0] if around else [2.2, 1.0]
        figure = Figure(figsize=(10, 2.0 * sum(heights) + 0.4), dpi=120, facecolor="white")
        all_axes = figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0]
        _draw(result, joints, list(all_axes), title)
        figure.align_ylabels(all_axes)
        figure.tight_layout(h_pad=0.6)
        try:
            figure.savefig(target, metadata={"Date": None} if target.suffix.lower() == ".svg" else None)
        except OSError as error:
            raise SaveError(target, error.strerror or str(error)) from None


def _draw(result: CheckReport, joints: Joints, all_axes: Sequence[Any], title: str) -> None:
    path = result.path
    count = len(path.times_s)
    drawn = np.linspace(0, max(count - 1, 0), min(count, _DRAWN)).astype(np.int64)
    times = path.times_s[drawn]
    for axes in all_axes:
        _style_axes(axes)
    _joints(
        all_axes[0], joints, times, path.joint_positions[drawn] if len(times) else np.zeros((0, len(joints)))
    )
    all_axes[1].plot(times, path.tool_speeds[drawn] * 1000, color=_CURVES[0], linewidth=1.1)
    all_axes[1].set_ylabel("tool speed\nmm/s")
    all_axes[1].set_ylim(bottom=0)
    if len(all_axes) > 2:
        clear = path.clearances[drawn] * 1000
        all_axes[2].plot(times, clear, color=_CURVES[2], linewidth=1.1)
        all_axes[2].set_ylabel("clearance\nmm")
        all_axes[2].set_ylim(0, max(float(clear.max(initial=0.0)) * 1.08, 1.0))
    all_axes[-1].set_xlabel("s")
    all_axes[-1].set_xlim(0, max(result.duration_s, 1e-3))
    _statements(all_axes[0], path.times_s, path.lines)
    _violations(all_axes, result.violations)
    wrong = len(result.violations)
    found = f"{wrong} violation{'' if wrong == 1 else 's'}" if wrong else "nothing wrong"
    all_axes[0].set_title(
        f"{title}: {result.duration_s:.2f} s, {found}",
        loc="left",
        fontsize=10,
        fontweight="bold",
        pad=20,
        parse_math=False,
    )


def _style_axes(axes: Any) -> None:
    axes.set_facecolor("white")
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(axis="y", color=_LINE, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(colors=_DIM, length=3)
    axes.yaxis.label.set_color(_DIM)
    axes.xaxis.label.set_color(_DIM)


def _joints(axes: Any, joints: Joints, times: FloatArray, positions: FloatArray) -> None:
    rotary = np.array([kind is JointType.ROTARY for kind in joints.types])
    shown = np.where(rotary, np.degrees(positions), positions * 1000)
    for number, name in enumerate(joints.names):
        axes.plot(
            times, shown[:, number], color=_CURVES[number % len(_CURVES)], linewidth=1.2, label=name,
            linestyle="-" if number < len(_CURVES) else "--",
        )  # fmt: skip
    units = [unit for unit, there in (("°", rotary.any()), ("mm", not rotary.all())) if there]
    axes.set_ylabel(f"joints\n{', '.join(units)}")
    axes.legend(
        loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, labelcolor=_TEXT, handlelength=1.4
    )


def _statements(axes: Any, times: FloatArray, lines: NDArray[np.int64]) -> None:
    """Mark where each statement begins, with its line number above; leave out marks that would touch."""
    if not len(lines):
        return
    begins = np.concatenate([[0], np.flatnonzero(np.diff(lines)) + 1])
    gap = float(times[-1]) / _MOST_LINE_NUMBERS
    last = -np.inf
    for begin in begins.tolist():
        if times[begin] - last < gap:
            continue
        last = float(times[begin])
        axes.axvline(last, color=_LINE, linewidth=0.6, zorder=0)
        axes.annotate(
            f"line {lines[begin]}" if begin == 0 else str(lines[begin]),
            (last, 1.0), xytext=(0, 3), xycoords=("data", "axes fraction"), textcoords="offset points",
            fontsize=7, color=_DIM, ha="left" if begin == 0 else "center",
        )  # fmt: skip


def _violations(all_axes: Sequence[Any], violations: Sequence[Violation]) -> None:
    """Draw a band for each violation on its panel: red if the motion is refused, amber for a warning."""
    concerned = {ViolationKind.SPEED: 1, ViolationKind.COLLISION: 2, ViolationKind.CLEARANCE: 2}
    bands: dict[tuple[int, ViolationKind, bool], list[tuple[float, float]]] = {}
    for each in violations:
        panel = min(concerned.get(each.kind, 0), len(all_axes) - 1)
        bands.setdefault((panel, each.kind, each.refuses), []).append((each.time_s, each.until_s))
    refused = [
        [span for key, spans in bands.items() if key[0] == panel and key[2] for span in spans]
        for panel in range(len(all_axes))
    ]
    # Draw refusals last, over the warnings.
    for (panel, kind, refuses), spans in sorted(bands.items(), key=lambda item: item[0][2]):
        color = _ALARM if refuses else _WARNING
        for begin, until in _merged(spans)[:_MOST_BANDS]:
            axes = all_axes[panel]
            axes.axvspan(begin, until, facecolor=color, alpha=0.16, linewidth=0)
            axes.axvline(begin, color=color, linewidth=0.9)
            if not refuses and any(other[0] <= until and begin <= other[1] for other in refused[panel]):
                continue  # a refusal's label is there
            # Lower, so that a collision's label does not cover that of the clearance before it.
            down = 18 if kind is ViolationKind.COLLISION else 9
            axes.annotate(
                str(kind) if refuses else f"{kind} (warning)", (begin, 1.0), xytext=(2, -down),
                xycoords=("data", "axes fraction"), textcoords="offset points", fontsize=7, color=color,
            )  # fmt: skip


def _merged(spans: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Merge overlapping spans."""
    united: list[tuple[float, float]] = []
    for begin, until in sorted(spans):
        if united and begin <= united[-1][1]:
            united[-1] = (united[-1][0], max(until, united[-1][1]))
        else:
            united.append((begin, until))
    return united
