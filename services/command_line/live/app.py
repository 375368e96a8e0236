"""The commands that attach to a running mesh."""

from pathlib import Path
from typing import Annotated

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.terminal.options import Connect, Height, Json, Robot, Width, command_group

app = command_group()


@app.command("list")
def list_(
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
    watch: Annotated[bool, typer.Option("--watch", help="Repeat until Ctrl-C.")] = False,
) -> None:
    """List sites, robots and services, with monitors, control, ages and round trips."""
    from services.command_line.live import listing

    listing.run(connect, as_json, watch)


@app.command()
def monitor(
    robot: Robot,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
    count: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            help="End after N live states. Without it, the first line may be the last value from before.",
        ),
    ] = None,
) -> None:
    """Watch a robot in the terminal."""
    from services.command_line.live import monitor as command

    command.run(robot, connect, as_json, count)


@app.command()
def signals(
    robot: Robot,
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME...]", help='Start of names, also with *: "io.", "joint.*.current".'),
    ] = None,
    follow: Annotated[bool, typer.Option("--follow", help="Repeat with each message until Ctrl-C.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Print what a robot's controller reports in addition to joints: I/O, currents, program, modes."""
    from services.command_line.live import signals as command

    command.run(robot, names or [], connect, as_json, follow)


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
    from services.command_line.live import send as command

    command.run(robot, words, connect, operator, as_json, reason=reason, looked=looked)


@app.command()
def fault(
    robot: Robot,
    name: Annotated[
        str,
        typer.Argument(metavar="[NAME[@BEGIN][+LENGTH]]", help="The fault; without it, list all faults."),
    ] = "",
    off: Annotated[bool, typer.Option("--off", help="End the fault.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Make a simulated controller misbehave: freeze, flood, jump, ..."""
    from services.command_line.live import fault as command

    command.run(robot, name, off, connect, as_json)


@app.command()
def snapshot(
    robot: Robot,
    view: Annotated[str, typer.Argument(metavar="VIEW", help="front, top, left, free, ...")],
    out: Annotated[Path, typer.Argument(metavar="OUT.png")],
    width: Width = 0,
    height: Height = 0,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Save a rendered picture of a robot."""
    from services.command_line.live import snapshot as command

    command.run(robot, view, out, (width, height), connect)


@app.command()
def video(
    robot: Robot,
    view: Annotated[str, typer.Argument(metavar="VIEW", help="front, top, left, free, ...")],
    out: Annotated[Path, typer.Argument(metavar="OUT.mp4")],
    seconds: Annotated[float, typer.Option(metavar="N", help="Length of the video; 0: until Ctrl-C.")] = 0.0,
    width: Width = 0,
    height: Height = 0,
    fps: Annotated[float, typer.Option(help="Highest frame rate; 0: the renderer's own.")] = 0.0,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Save rendered video of a robot, playable while it is written."""
    from services.command_line.live import video as command

    command.run(robot, view, out, command.Wanted(seconds, width, height, fps), connect, as_json)


@app.command()
def record(
    robot: Robot,
    name: Annotated[str, typer.Option(help="Name of the recording.")] = "",
    view: Annotated[
        list[str] | None,
        typer.Option(metavar="VIEW", help="Record this view's video too; repeatable; -: no video."),
    ] = None,
    stop: Annotated[bool, typer.Option("--stop", help="End its recording, whoever started it.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Record a robot until Ctrl-C."""
    from services.command_line.recordings import record as command

    if not stop:
        command.record(robot, name, view or (), connect, as_json)
    elif name or view:
        raise typer.BadParameter("--stop ends a recording: give it without --name and --view")
    else:
        command.stop(robot, connect, as_json)


@app.command()
def alive(
    service: Annotated[
        str, typer.Argument(metavar="[SITE/]SERVICE", help="As `list` shows it: router, gateway, ...")
    ],
    connect: Connect = DEFAULT_ROUTER,
) -> int:
    """Check that a service answers: exit status 0 or 1, for health checks."""
    from services.command_line.live import alive as command

    return command.run(service, connect)
