"""`robomesh send`: one command to a robot, under a lease held until its motion ends."""

import asyncio
import sys
from math import radians
from pathlib import Path
from typing import NamedTuple

import typer

from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.keys import check_chunk, robot_key
from robomesh.lease import control
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from services.command_line import discovery
from services.command_line.live.command_progress import (
    Interrupted,
    answered,
    interrupt,
    stop,
    until_done,
    warning_of,
)
from services.command_line.output import print_or_discard
from services.errors import ServiceError

_Command = schema.CommandRequest
_VALID_NS = 3_000_000_000
_MOTIONS = (_Command.HOME, _Command.MOVE_ABSOLUTE, _Command.MOVE_RELATIVE, _Command.RESUME)
_WORDS = {
    ("home",): _Command.HOME,
    ("hold",): _Command.HOLD,
    ("resume",): _Command.RESUME,
    ("reset",): _Command.RESET,
    ("trace", "on"): _Command.TRACE_ON,
    ("trace", "off"): _Command.TRACE_OFF,
}
_USAGE = "home, stop, hold, resume, reset, trace on, trace off, speed N, move Q... (degrees, mm), or run FILE"
# The gateway plans and checks a whole program before it begins.
_PROGRAM_TIMEOUT_S = 60.0
_RECORDER_TIMEOUT_S = 0.5


class Sent(NamedTuple):
    """The end of a command: whether it was accepted and done, its text, and the check's warning."""

    accepted: bool
    text: str
    warning: str = ""


class WordsError(ServiceError):
    """The words are not a command."""


def run(robot: str, words: list[str], router: str, operator: str, as_json: bool) -> None:
    """Send a command; exit status 1 when it is refused."""
    if words != ["stop"]:
        _parse(words, None)  # before any request
    sent = discovery.run(_send(robot, words, router, check_chunk(operator or discovery.own_name())))
    print_or_discard(discovery.json_line(sent._asdict()) if as_json else sent.text, sys.stdout)
    if not sent.accepted:
        raise typer.Exit(1)


async def _send(name: str, words: list[str], router: str, operator: str) -> Sent:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        if words == ["stop"]:
            return Sent(*await stop(session, robot, operator, "robomesh send stop"))
        description = await session.last(robot_key(*robot, "description"))
        known = description if isinstance(description, schema.Description) else None
        if known is None and words[0] == "move":
            return Sent(
                False,
                f"{robot} has no description to convert degrees and mm with: start its kinematics",
            )
        request = _parse(words, known)
        try:
            async with control(session, *robot, operator) as own:
                request.lease = own.lease
                request.id = 1
                # By the gateway's clock: a delayed command must not move an arm later.
                runs = request.command == _Command.RUN_PROGRAM
                waits_ns = round(_PROGRAM_TIMEOUT_S * 1e9) if runs else _VALID_NS
                request.not_after.FromNanoseconds(own.now_ns + waits_ns)
                if request.command == _Command.RESET:
                    request.stop_id = await _latched_stop(session, robot)
                sent = await _send_and_wait(session, robot, operator, request, own.renewing)
                if sent.accepted and request.command == _Command.TRACE_ON:
                    sent = sent._replace(text=sent.text + await joined(session, robot))
        except RefusedError as error:
            sent = Sent(False, with_commands(error, robot))
        return sent


async def _send_and_wait(
    session: Session,
    robot: discovery.Robot,
    operator: str,
    request: schema.CommandRequest,
    renewing: asyncio.Task[str],
) -> Sent:
    """Send a command and wait until its motion or program ends; Ctrl-C stops the robot."""
    runs, warning = request.command == _Command.RUN_PROGRAM, ""
    with interrupt() as interrupted:
        try:
            key = robot_key(*robot, f"command/{operator}")
            timeout_s = _PROGRAM_TIMEOUT_S if runs else 2.0
            answer = await answered(session, key, request, interrupted, timeout_s=timeout_s)
            if not answer.accepted or not (runs or request.command in _MOTIONS):
                return Sent(answer.accepted, answer.text)
            warning = warning_of(answer)
            if warning:
                print_or_discard(f"warning: {warning}", sys.stderr)
            done, text = await until_done(session, robot, operator, renewing, interrupted, runs=runs)
            return Sent(done, text, warning)
        except Interrupted:
            _, said = await stop(session, robot, operator, "Ctrl-C in robomesh send")
            return Sent(False, f"interrupted: {said}", warning)


async def joined(session: Session, robot: discovery.Robot) -> str:
    """Return the recording that a trace joins, in words; empty: the trace has its own."""
    last = await session.last(robot_key(*robot, "recording"), timeout_s=_RECORDER_TIMEOUT_S)
    if isinstance(last, schema.Recording) and last.open and last.started_by == "request":
        return f"; recorded in {last.name!r}, which is being recorded already"
    return ""


def with_commands(error: RefusedError, robot: discovery.Robot) -> str:
    """Return a refusal's sentence, with its advice as a command to type."""
    text, reason = str(error), error.reason
    if reason.code in (codes.STOP_LATCHED.name, codes.STOP_OTHER.name):
        advice = f"send RESET with stop_id {reason.values.get('id')}"
        text = text.replace(advice, f"`robomesh send {robot} reset`")
    if reason.code == codes.LEASE_OTHER.name:
        text = (
            f"{text.rstrip('.')}. Only that window or program can hold what it moves; "
            f"Ctrl-C there, or `robomesh send {robot} stop`, ends it"
        )
    return text


async def _latched_stop(session: Session, robot: discovery.Robot) -> int:
    """Return the id of the stop for a RESET; 0: none is latched, only the controller itself is stopped."""
    state = await session.last(robot_key(*robot, "controller"))
    return state.stop.id if isinstance(state, schema.ControllerState) else 0


def _parse(words: list[str], description: schema.Description | None) -> schema.CommandRequest:
    """Return the request for the words; its joint positions are in SI only with a description.

    Raises:
        WordsError: If the words are not a command.
    """
    command = _WORDS.get(tuple(words))
    if command is not None:
        return _Command(command=command)
    match words:
        case ["speed", percent]:
            return _Command(command=_Command.SPEED, speed_percent=_number(percent))
        case ["run", file]:
            return _Command(
                command=_Command.RUN_PROGRAM, program=_program(Path(file)), program_name=Path(file).stem
            )
        case ["move", *values] if values:
            positions = [_number(value) for value in values]
            if description is not None:
                if len(positions) != len(description.joints):
                    names = ", ".join(joint.name for joint in description.joints)
                    raise WordsError(
                        f"move takes {len(description.joints)} positions ({names}), not {len(positions)}"
                    )
                positions = [
                    radians(value) if joint.type == schema.Description.Joint.ROTARY else value / 1000.0
                    for value, joint in zip(positions, description.joints, strict=True)
                ]
            return _Command(command=_Command.MOVE_ABSOLUTE, joint_positions=positions)
    raise WordsError(f"{' '.join(words)!r} is not a command: {_USAGE}")


def _program(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise WordsError(f"{path}: cannot be read: {reason}") from None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise WordsError(f"{text!r} is not a number: {_USAGE}") from None
