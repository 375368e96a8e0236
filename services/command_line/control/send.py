"""`robomesh send`: one command to a robot, under a lease held until its motion ends."""

import asyncio
import signal
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import typer

from robomesh import reason_codes as codes
from robomesh.client.robot.commands import CommandResult, Progress, program_text, request_stop
from robomesh.client.robot.control import AsyncArm
from robomesh.client.robot.robot import AsyncRobot
from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import check_chunk
from robomesh.errors import CodedError, MotionError, NoAnswerError, RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Json, Robot, command_group
from services.command_line.terminal.output import json_line, print_line
from services.errors import ServiceError

app = command_group()

T = TypeVar("T")
_Command = Callable[[AsyncArm], Coroutine[Any, Any, CommandResult]]

_STOP, _TRACE_ON = ["stop"], ["trace", "on"]
_WORDS: dict[tuple[str, ...], _Command] = {
    ("home",): AsyncArm.home,
    ("hold",): AsyncArm.hold,
    ("resume",): AsyncArm.resume,
    ("reset",): AsyncArm.reset,
    ("trace", "on"): lambda arm: arm.trace(True),
    ("trace", "off"): lambda arm: arm.trace(False),
}
_USAGE = (
    "home, stop, hold, resume, reset, trace on, trace off, speed N, move Q... (degrees, mm), run FILE, or "
    "recover NAME"
)
_RECORDER_TIMEOUT_S = 0.5


class CommandOutcome(NamedTuple):
    """The end of a command: whether it was accepted and done, its text, and the check's warning."""

    accepted: bool
    text: str
    warning: str = ""


class WordsError(ServiceError):
    """The words are not a command."""


@app.command(context_settings={"ignore_unknown_options": True})
def send(
    robot: Robot,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="COMMAND",
            help="home, stop, hold, resume, reset, trace on, trace off, speed N, move Q... (degrees, mm), "
            "run FILE (a teach program), recover NAME (unlock_protective_stop, power_on, ...)",
        ),
    ],
    connect: Connect = DEFAULT_ROUTER,
    operator: Annotated[str, typer.Option(help="The operator's name; else yours.")] = "",
    reason: Annotated[str, typer.Option(help="Of recover: why, for the audit log.")] = "",
    looked: Annotated[
        bool, typer.Option("--looked", help="Of recover: a person at the robot has found the cause.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Send a command to a robot and wait until it ends; Ctrl-C stops the robot.

    Takes control, holds it until the motion ends, and gives it back. Only the sender of a motion can hold and
    resume it: another send cannot. Ctrl-C in the sender ends the motion, and so does `stop` from anywhere,
    which needs no control.
    """
    # Before any request.
    if words[:1] == ["recover"]:
        command: _Command | None = _recovery(words[1:], reason, looked)
    elif reason or looked:
        raise WordsError("--reason and --looked belong to recover NAME only")
    else:
        command = None if words == _STOP else _parse(words)
    sent = discovery.run(_send(robot, words, command, connect, check_chunk(operator or discovery.own_name())))
    print_line(json_line(sent._asdict()) if as_json else sent.text, lasting=True)
    if not sent.accepted:
        raise typer.Exit(1)


async def _send(
    name: str, words: list[str], command: _Command | None, router: str, operator: str
) -> CommandOutcome:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        if command is None:
            stopped = await request_stop(session, *robot, operator, "robomesh send stop")
            return CommandOutcome(stopped.sent, stopped.text)
        sent = await send_and_wait(session, robot, operator, command)
        if sent.accepted and words == _TRACE_ON:
            sent = sent._replace(text=sent.text + await joined(session, robot))
        return sent


async def send_and_wait(
    session: Session, robot: discovery.RobotAddress, operator: str, command: _Command
) -> CommandOutcome:
    """Take control, and send a command; wait until its motion or program ends. Ctrl-C stops the robot."""
    started: list[CommandResult] = []  # the motion or program

    def on_accepted(answer: CommandResult) -> None:
        started.append(answer)
        if answer.warning:
            print_line(f"warning: {answer.warning}", err=True)

    arm = AsyncRobot(session, *robot).control(operator)
    arm.progress = Progress(on_accepted, _print_step, stop_reason="Ctrl-C in robomesh send")

    async def controlled() -> CommandResult:
        async with arm:
            return await command(arm)

    try:
        answer = await _interruptible(controlled())
        return CommandOutcome(True, "done" if started else answer.text, answer.warning)
    except asyncio.CancelledError:
        if arm.stopped is None:  # the robot did not move
            raise typer.Abort from None
        ended = f"interrupted: {arm.stopped.text}"
    except (RefusedError, MotionError, NoAnswerError) as error:
        if isinstance(error, NoAnswerError) and not started:
            raise
        ended = with_commands(error, robot)
    return CommandOutcome(False, ended, started[0].warning if started else "")


async def _interruptible(waiting: Coroutine[Any, Any, T]) -> T:
    """Return a coroutine's result; Ctrl-C cancels it."""
    task = asyncio.create_task(waiting)

    def cancel() -> None:
        if not task.cancelling():  # a second Ctrl-C must not cancel the stop
            task.cancel()

    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGINT, cancel)
    try:
        return await task
    finally:
        loop.remove_signal_handler(signal.SIGINT)


def _print_step(program: schema.ProgramState) -> None:
    step = f"step {program.step} of {program.steps}"
    print_line(f"{step}, line {program.line}: {program.statement}", err=True)


async def joined(session: Session, robot: discovery.RobotAddress) -> str:
    """Return the recording that a trace joins, in words; empty: the trace has its own."""
    last = await session.last(f"robomesh/{robot}/recording", timeout_s=_RECORDER_TIMEOUT_S)
    if isinstance(last, schema.Recording) and last.open and last.started_by == "request":
        return f"; recorded in {last.name!r}, which is being recorded already"
    return ""


def with_commands(error: CodedError, robot: discovery.RobotAddress) -> str:
    """Return an error's sentence, with its advice as a command to type."""
    text, reason = str(error), error.reason
    if reason.code in (codes.STOP_LATCHED.name, codes.STOP_OTHER.name):
        advice = f"send RESET with stop_id {reason.values.get('id')}"
        text = text.replace(advice, f"`robomesh send {robot} reset`")
    if reason.code == codes.LEASE_OTHER.name:
        text = (
            f"{text.rstrip('.')}. Only that window or program can hold what it moves; "
            f"Ctrl-C there, or `robomesh send {robot} stop`, ends it"
        )
    if reason.code == codes.ENDED_GATEWAY.name or isinstance(error, NoAnswerError):
        text = (
            f"{text}. `robomesh send {robot} stop` makes sure that the robot stands still, "
            f"`robomesh send {robot} reset` lets it move again"
        )
    return text


def _parse(words: list[str]) -> _Command:
    """Return the command for the words.

    Raises:
        WordsError: If the words are not a command.
        MessageError: If the program's file cannot be read.
    """
    match words:
        case ["speed", percent]:
            number = _number(percent)
            return lambda arm: arm.speed(number)
        case ["run", file]:
            text, name = program_text(Path(file)), Path(file).stem
            return lambda arm: arm.run(text, name=name)
        case ["move", *values] if values:
            positions = [_number(value) for value in values]
            return lambda arm: arm.move_joints_deg(positions)
    command = _WORDS.get(tuple(words))
    if command is None:
        raise WordsError(f"{' '.join(words)!r} is not a command: {_USAGE}")
    return command


def _recovery(words: list[str], reason: str, looked: bool) -> _Command:
    """Return the command that recovers a controller.

    Raises:
        WordsError: If a name, the reason or the confirmation is missing.
    """
    if len(words) != 1:
        names = ", ".join(name.lower() for name in schema.Recover.Recovery.keys()[1:])
        raise WordsError(f"recover needs one name: {names}")
    if not reason.strip():
        raise WordsError("recover needs a reason: --reason TEXT")
    if not looked:
        raise WordsError("recover needs --looked, after a person at the robot has found the cause")
    return lambda arm: arm.recover(words[0], reason=reason, looked=looked)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise WordsError(f"{text!r} is not a number: {_USAGE}") from None
