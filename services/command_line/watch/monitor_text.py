"""Texts and JSON values of `robomesh monitor` besides the joints: clearances, checks, programs, replays."""

import math
from collections.abc import Iterable
from datetime import datetime
from typing import Any

from robomesh.contract.enum_names import enum_name, enum_word
from robomesh.contract.keys import WHOLE_SITE
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.terminal.local_time import local_time, time_text

_State = schema.ControllerState
_Program = schema.ProgramState
_Alarm = schema.Alarm
_MOST_ALARMS = 4

_CHECKS = {
    _State.OFF: "not checked",
    _State.WARN: "checked, warned of",
    _State.REQUIRE: "checked, refused unless free",
}
_STYLES = ("", "bold yellow", "bold red")

# A text and its style.
Words = tuple[str, str]
OLD = "dim strike"


def replay_words(state: schema.ReplayState | None) -> str:
    """Describe a replay's recording and position; without a state just as a replay."""
    if state is None:
        return "REPLAY"
    how = f"{state.speed:g} x" if state.playing else "paused"
    return (
        f"REPLAY of {state.of_site}/{state.of_robot}   recorded {time_text(_recorded(state))}, "
        f"{state.position_s:.0f} of {state.duration_s:.0f} s, {how}"
    )


def replay_record(state: schema.ReplayState | None) -> dict[str, Any]:
    """Return a replay's recording and position as JSON values; empty without a state."""
    if state is None:
        return {}
    return {
        "of": f"{state.of_site}/{state.of_robot}",
        "file": state.file,
        "recorded": _recorded(state).isoformat(timespec="milliseconds"),
        "position_s": state.position_s,
        "duration_s": state.duration_s,
        "speed": state.speed,
        "playing": state.playing,
    }


def _recorded(state: schema.ReplayState) -> datetime:
    """Return when the current position was recorded, in local time."""
    return local_time(state.start.ToNanoseconds() * 1e-9 + state.position_s)


def near_words(
    state: schema.KinematicState, description: schema.Description | None, robot: str
) -> list[Words]:
    """Return clearances and singularity margin, each with its style.

    Args:
        robot: `<site>/<robot>`.
    """
    words = []
    if state.HasField("clearance"):
        distance = state.clearance.distance
        warning, stop = (
            (0.0, 0.0) if description is None else (description.warning_distance, description.stop_distance)
        )
        level = 2 if distance <= 0 or distance < stop else 1 if distance < warning else 0
        words.append((f"clearance {_distance(state.clearance, robot)}", _STYLES[level]))
    if state.HasField("own_clearance"):
        touching = state.own_clearance.distance <= 0
        words.append((f"own links {_distance(state.own_clearance, robot)}", _STYLES[2 * touching]))
    if state.HasField("singularity_margin"):
        words.append((f"singularity margin {state.singularity_margin:.3f}", ""))
    if state.not_counted:
        words.append((f"not counted, at unknown positions: {', '.join(state.not_counted)}", _STYLES[1]))
    return words


def alarm_words(alarms: Iterable[schema.Alarm], robot: str) -> list[Words]:
    """Return a line for each of the most urgent alarms of a robot and its site that are not shelved."""
    own = [each for each in alarms if each.robot in (robot, WHOLE_SITE) and each.state != _Alarm.SHELVED]
    words = []
    for alarm in own[:_MOST_ALARMS]:
        level = 2 if alarm.priority >= _Alarm.HIGH else 1
        quiet = alarm.state != _Alarm.UNACKNOWLEDGED
        state = f", {enum_word(_Alarm.State, alarm.state)}" if quiet else ""
        priority = enum_name(_Alarm.Priority, alarm.priority)
        words.append((f"ALARM {priority}{state}: {alarm.text}", "" if quiet else _STYLES[level]))
    if len(own) > _MOST_ALARMS:
        words.append((f"and {len(own) - _MOST_ALARMS} more alarms: robomesh alarms list", ""))
    return words


def check_words(state: schema.ControllerState) -> Words | None:
    """Describe the check of motions; None: the gateway does not report it."""
    if state.check == _State.CHECK_UNSPECIFIED:
        return None
    if state.check_text:
        refused = "refused" if state.check == _State.REQUIRE else "not checked"
        return f"motions: {refused} now: {state.check_text}", _STYLES[1]
    return f"motions: {_CHECKS.get(state.check) or f'check {state.check}'}", ""


def program_words(state: schema.ProgramState, *, stale: bool = False) -> Words | None:
    """Describe the running or last program; None: no program ran."""
    where = f"line {state.line}: {state.statement}"
    match state.outcome:
        case _Program.RUNNING:
            elapsed_s = (state.timestamp.ToNanoseconds() - state.since.ToNanoseconds()) * 1e-9
            left = f", {clock(-(-state.left_s // 1))} left" if state.HasField("left_s") else ""
            return (
                f"program {state.name}: step {state.step} of {state.steps}, {where}; "
                f"by {state.operator}, for {clock(elapsed_s)}{left}"
            ), OLD if stale else "bold"
        case _Program.DONE:
            return f"program {state.name}: done, by {state.operator}", ""
        case _Program.ENDED:
            return f"program {state.name}, by {state.operator}: ended at {where}: {state.text}", _STYLES[1]
        case _Program.OUTCOME_UNSPECIFIED:
            return None
    outcome = enum_word(_Program.Outcome, state.outcome)
    return f"program {state.name}, by {state.operator}: {outcome} at {where}: {state.text}", _STYLES[1]


def clearance_record(state: schema.KinematicState | None, robot: str) -> dict[str, Any] | None:
    """Return an arm's least clearance as JSON values; None: unknown, or nothing is around the arm.

    Args:
        robot: `<site>/<robot>`.
    """
    if state is None or not state.HasField("clearance"):
        return None
    near = state.clearance
    site = robot.partition("/")[0]
    pair = [frame.removeprefix(f"{site}/") for frame in (near.first, near.second)]
    return {"distance_m": near.distance, "pair": pair}


def program_record(state: schema.ProgramState | None) -> dict[str, Any] | None:
    """Return the running or last program as JSON values; None: no program ran, or unknown."""
    if state is None or state.outcome == _Program.OUTCOME_UNSPECIFIED:
        return None
    outcome = enum_word(_Program.Outcome, state.outcome)
    values = {name: getattr(state, name) for name in ("name", "operator", "line", "step", "steps", "text")}
    return {"outcome": outcome, **values}


def _distance(clearance: schema.Clearance, robot: str) -> str:
    site = robot.partition("/")[0]
    first, second = (
        frame.removeprefix(f"{robot}/").removeprefix(f"{site}/").replace("/", " ")
        for frame in (clearance.first, clearance.second)
    )
    far = "touching" if clearance.distance <= 0 else f"{1000 * clearance.distance:.1f} mm"
    return f"{far} ({first} - {second})"


def clock(seconds: float) -> str:
    """Format a duration as minutes and seconds: 00:12."""
    if not math.isfinite(seconds):
        return f"{seconds} s"
    return f"{int(seconds) // 60:02d}:{int(seconds) % 60:02d}"
