"""The text of `robomesh list`: a table of robots, a table of services, a line for each site."""

from collections.abc import Iterable
from datetime import datetime
from typing import TYPE_CHECKING, Any

from robomesh.contract.keys import WHOLE_SITE
from services.command_line.terminal.local_time import local_time, time_text
from services.command_line.terminal.output import styled

if TYPE_CHECKING:
    from rich.console import Group
    from rich.table import Table

# Least column widths: the longest word of each.
_LEAST = {"mode": len("automatic"), "in control": len("control")}
# A narrower terminal shows fewer columns.
_WIDE = 96
_CLOCK_OFF_S = 0.5


def listing_text(found: dict[str, Any], width: int) -> "Group":
    """Return the tables and lines of a listing.

    Args:
        found: The listing as `--json` prints it.
        width: Width of the terminal, in characters.
    """
    from rich.console import Group

    parts: list[Any] = [_robots(found, width)] if any(not row["replay"] for row in found["robots"]) else []
    parts += [
        styled(f" {row['site']}/{row['robot']}   replay {_replay(row['replay'])}", "magenta")
        for row in found["robots"]
        if row["replay"] is not None
    ]
    parts.append(_services(found["services"], width))
    problems = {(row["id"], each): row for row in found["services"] for each in row["problems"]}
    for (_, problem), row in problems.items():
        parts.append(styled(f" {row['site']}: {row['service']}: {problem}", "yellow"))
    parts += [styled(f" {_site(row)}", _alarm_style(row)) for row in found["sites"]]
    if found["partial"]:
        text = " This list is partial: it leaves out sessions of operators and monitors, which are too many."
        parts.append(styled(text, "yellow"))
    return Group(*parts)


def _robots(found: dict[str, Any], width: int) -> "Table":
    table = _table(("robot", "link", "mode", "state", "age", "in control"), width)
    for row in found["robots"]:
        if row["replay"] is not None:
            continue
        age = "-" if row["age_s"] is None else f"{row['age_s']:.1f} s"
        link = row["link"] + (f", {row['rate_hz']:.0f} Hz" if row["rate_hz"] else "")
        holder = row["holder"] or "nobody"
        name = f"{row['site']}/{row['robot']}"
        table.add_row(name, link, row["mode"], _state(row), age, holder, style=_robot_style(row))
    return table


def _services(services: Iterable[dict[str, Any]], width: int) -> "Table":
    """Return a table with one row for each process, which may serve several robots."""
    rows: dict[str, dict[str, Any]] = {}
    robots: dict[str, list[str]] = {}
    for each in services:
        rows.setdefault(each["id"], each)
        robots.setdefault(each["id"], []).append(each["robot"])
    names = ["service", "of", "at", "version", "age", "round trip", "clock", "CPU", "memory", "lost"]
    if width < _WIDE:
        names = ["service", "of", "age", "round trip", "clock", "lost"]
    table = _table(names, width, right=("age", "round trip", "clock", "CPU", "memory", "lost"))
    for identity, row in sorted(
        rows.items(), key=lambda each: (each[1]["site"], each[1]["service"], each[0])
    ):
        cells = {
            "service": row["service"],
            "of": _of(row["site"], robots[identity]),
            "at": row["host"] or "-",
            "version": row["version"] or "-",
            "age": _number(row["age_s"], "{:.1f} s"),
            "round trip": _number(row["round_trip_s"], "{:.1f} ms", 1000),
            "clock": _clock(row),
            "CPU": _number(row["cpu"], "{:.0f} %", 100),
            "memory": _number(row["memory_bytes"], "{:.0f} MB", 1e-6),
            "lost": "-" if row["lost"] is None else f"{row['lost']}",
        }
        off = abs(row["clock_offset_s"] or 0.0) - (row["round_trip_s"] or 0.0) / 2 > _CLOCK_OFF_S
        table.add_row(*(cells[name] for name in names), style="yellow" if off else None)
    return table


def _table(names: Iterable[str], width: int, *, right: tuple[str, ...] = ("age",)) -> "Table":
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for name in names:
        # Fold long cells into the next line instead of cutting them.
        table.add_column(
            name,
            no_wrap=name in ("robot", "service") and width >= _WIDE,
            overflow="fold",
            min_width=_LEAST.get(name),
            justify="right" if name in right else "left",
        )
    return table


def _of(site: str, robots: list[str]) -> str:
    names = sorted(set(robots) - {WHOLE_SITE})
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    return f"{site}/{', '.join(names[:3])}{more}" if names else site


def _number(value: float | None, form: str, factor: float = 1.0) -> str:
    return "-" if value is None else form.format(value * factor)


def _clock(row: dict[str, Any]) -> str:
    """Return how far the process's clock is ahead, with its uncertainty."""
    if row["clock_offset_s"] is None:
        return "-"
    offset_ms, about_ms = 1000 * row["clock_offset_s"], 500 * row["round_trip_s"]
    if abs(offset_ms) <= about_ms:
        return f"same ±{about_ms:.1f} ms"
    return f"{offset_ms:+.0f} ±{about_ms:.0f} ms" if abs(offset_ms) < 1e4 else f"{offset_ms / 1000:+.1f} s"


def _site(row: dict[str, Any]) -> str:
    if row["gone_since"] is not None:
        return f"{row['site']} — gone since {since(row['gone_since'])}"
    words = "no watch, so no alarms"
    if row["alarms"] is not None:
        counts = [f"{count} {state}" for state, count in sorted(row["alarms"].items())]
        words = f"alarms: {', '.join(counts)}" if counts else "no alarms"
        urgent = row["most_urgent"]
        words += f" ({urgent['id']}: {urgent['text']})" if urgent is not None else ""
    watched = f", watched by {row['monitors']}" if row["monitors"] else ""
    return f"{row['site']}   {words}{watched}"


def since(at_s: float) -> str:
    """Format a time of today as a time, an earlier one with its date."""
    at = local_time(at_s)
    today = at.date() == datetime.now().astimezone().date()
    return time_text(at).partition(" ")[2] if today else time_text(at, "minutes")


def _alarm_style(row: dict[str, Any]) -> str:
    urgent = row["gone_since"] is not None or (row["alarms"] or {}).get("unacknowledged")
    return "bold red" if urgent else ""


def _robot_style(row: dict[str, Any]) -> str | None:
    return None if row["link"] == "up" else "yellow"


def _replay(row: dict[str, Any]) -> str:
    how = f"{row['speed']:g} x" if row["playing"] else "paused"
    return f"of {row['of']}, {row['position_s']:.0f} of {row['duration_s']:.0f} s, {how}"


def _state(row: dict[str, Any]) -> str:
    """Return what the robot does, and what blocks its motion."""
    words = [row["state"]]
    if row["stop_id"] is not None:
        words.append(f"stop {row['stop_id']} latched")
    if row["slow_hz"] is not None:
        words.append(f"slow, joints at {row['slow_hz']:g} Hz")
    if row["joints_unproven"]:
        words.append("joints unproven")
    if row["read_only"]:
        words.append("read-only")
    elif row["stops"] == "not_now" and row["link"] == "up":
        words.append("a stop cannot be sent now")
    elif row["stops"] == "ours":
        words.append("a stop ends our motions only")
    if row["dies_with_link"] is False:
        words.append("a motion goes on without the gateway")
    return ", ".join(words)
