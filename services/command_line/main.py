"""`robomesh`: its commands, what they take, and how they end.

Exit status 0: done; 1: done, and the answer is no; 2: could not, and one line says why.
Everything heavy is imported by the command that needs it.
"""

import os
import select
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.main import get_command

from robomesh.endpoints import DEFAULT_ROUTER
from services.command_line import bridges
from services.command_line.accounts.app import accounts_app
from services.command_line.alarms.app import alarms_app
from services.command_line.connection_options import offer_keys
from services.command_line.kept import audit_app, recordings_app
from services.command_line.keys.app import keys_app
from services.command_line.keys.folder import KeysFolder, keys_folder
from services.command_line.options import Connect, Height, Json, Robot, Width
from services.command_line.output import show_directions
from services.command_line.program.app import program_app
from services.command_line.reading_limits import limit
from services.command_line.robot_and_mesh import mesh_app, robot_app
from services.command_line.site import app as site_commands

app = typer.Typer(
    name="robomesh",
    help="A service mesh that puts industrial robot arms on the network.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
for name, part in (
    ("robot", robot_app),
    ("mesh", mesh_app),
    ("program", program_app),
    ("recordings", recordings_app),
    ("audit", audit_app),
    ("alarms", alarms_app),
    ("keys", keys_app),
    ("accounts", accounts_app),
):
    app.add_typer(part, name=name)

site_commands.add(app)
bridges.add(app)

# ------------------------------------------------------------- what is there


@app.command("list")
def list_(
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
    watch: Annotated[bool, typer.Option("--watch", help="Again and again, until Ctrl-C.")] = False,
) -> None:
    """Sites, robots, services, who watches, who controls, how old, how far away."""
    from services.command_line.live import listing

    listing.run(connect, as_json, watch)


@app.command()
def monitor(
    robot: Robot,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
    count: Annotated[int | None, typer.Option(metavar="N", help="End after N states.")] = None,
) -> None:
    """Watch a robot in the terminal."""
    from services.command_line.live import monitor as command

    command.run(robot, connect, as_json, count)


@app.command(context_settings={"ignore_unknown_options": True})
def send(
    robot: Robot,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="COMMAND",
            help="home, stop, hold, resume, reset, trace on, trace off, speed N, move Q... (degrees, mm), "
            "run FILE (a teach program)",
        ),
    ],
    connect: Connect = DEFAULT_ROUTER,
    operator: Annotated[str, typer.Option(help="In whose name.")] = "",
    as_json: Json = False,
) -> None:
    """Command a robot: takes control, holds it until the motion ends, gives it back; Ctrl-C stops.

    Only who moves a robot can hold it and resume: what one send moves, another cannot hold. Ctrl-C there
    ends it, and so does stop from anywhere, which needs no control.
    """
    from services.command_line.live import send as command

    command.run(robot, words, connect, operator, as_json)


@app.command()
def fault(
    robot: Robot,
    name: Annotated[
        str,
        typer.Argument(
            metavar="[NAME[@BEGIN][+LENGTH]]", help="Without one: which there are, and what each does."
        ),
    ] = "",
    off: Annotated[bool, typer.Option("--off", help="End it.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Let a simulated controller misbehave: freeze, flood, jump, ..."""
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
    seconds: Annotated[float, typer.Option(metavar="N", help="Of video; 0: until Ctrl-C.")] = 0.0,
    width: Width = 0,
    height: Height = 0,
    fps: Annotated[float, typer.Option(help="Highest rate; 0: the renderer's own.")] = 0.0,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Save rendered video of a robot, playable while it is written."""
    from services.command_line.live import video as command

    command.run(robot, view, out, command.Wanted(seconds, width, height, fps), connect, as_json)


@app.command()
def record(
    robot: Robot,
    name: Annotated[str, typer.Option(help="Of the capture.")] = "",
    view: Annotated[
        list[str] | None,
        typer.Option(metavar="VIEW", help="Whose video too; more by repeating it; -: none."),
    ] = None,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Record a robot until Ctrl-C."""
    from services.command_line.recordings import record as command

    command.record(robot, name, view or (), connect, as_json)


@app.command()
def alive(
    service: Annotated[
        str, typer.Argument(metavar="[SITE/]SERVICE", help="As in list: router, gateway, ...")
    ],
    connect: Connect = DEFAULT_ROUTER,
) -> int:
    """Whether a service answers now: exit status 0 or 1, for health checks."""
    from services.command_line.live import alive as command

    return command.run(service, connect)


@app.command()
def doctor(
    security: Annotated[
        bool, typer.Option("--security", help="Try every role against every key, on the live mesh.")
    ] = False,
    folder: KeysFolder = None,
    routers: Annotated[
        str, typer.Option("--connect", metavar="tls/HOST:PORT", help="A router; the list's unless given.")
    ] = "",
    as_json: Json = False,
) -> int | None:
    """What is missing on this machine, and how to mend it."""
    if security:
        from services.command_line.connection_options import addresses
        from services.command_line.doctor import security as check

        return check.run(keys_folder(folder, quiet=as_json), addresses(routers), as_json)
    from services.command_line.doctor import machine as command

    command.run(as_json)
    return None


# ------------------------------------------------------- what a robot is


@app.command()
def fk(
    requests: Annotated[str, typer.Argument(metavar="-", help="JSON requests on standard input.")] = "-",
    robot: Annotated[str, typer.Option(metavar="R")] = "pt600",
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, in SI units: always so here.")] = True,
) -> None:
    """Forward kinematics: {"joints": [..]} a line in, {"tool", "links"} a line out."""
    from services.command_line.robot import commands

    commands.forward(robot, requests)


@app.command(context_settings={"ignore_unknown_options": True})
def ik(
    pose: Annotated[
        list[str],
        typer.Argument(
            metavar="X Y Z [ROLL PITCH YAW]",
            help="The tool's pose in the base frame, mm and degrees; - for JSON requests on standard input.",
        ),
    ],
    robot: Annotated[str, typer.Option(metavar="R")] = "pt600",
    task: Annotated[
        str, typer.Option(metavar="6d|5d|3d", help="The whole pose, position and tool axis, or position.")
    ] = "",
    all_: Annotated[bool, typer.Option("--all", help="All solutions, not the nearest to home.")] = False,
    as_json: Json = False,
) -> None:
    """Inverse kinematics: joint positions; JSON: {"pose", "task", "near", "all", "seed"} a line in."""
    from services.command_line.robot import inverse

    inverse.inverse(robot, pose, task, all_, as_json)


# --------------------------------------------------------------------- the end


def main() -> None:
    """The program."""
    show_directions()
    limit(next(iter(sys.argv[1:]), ""))
    status = run(sys.argv[1:])
    try:
        # What waits yet is said now: the interpreter's own end would tell who cannot hear it.
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        _say_no_more()
    sys.exit(status)


def run(arguments: list[str]) -> int:
    """Run one command; the exit status."""
    try:
        command = offer_keys(get_command(app))
        outcome: Any = command.main(arguments, prog_name="robomesh", standalone_mode=False)
        return outcome if isinstance(outcome, int) else 0
    except typer.TyperException as error:
        return _could_not(
            f"{error.format_message()} ({' '.join(['robomesh', *arguments[:1]])} --help tells more)"
        )
    except (KeyboardInterrupt, typer.Abort):
        return 130
    except MemoryError:
        return _could_not("it takes more memory to read than there is, or than 6 GB")
    except SystemExit:
        # So typer and rich end a command whose reader has gone.
        _say_no_more()
        return 0
    except Exception as error:
        # Services run their robots in task groups.
        while isinstance(error, ExceptionGroup):
            error = error.exceptions[0]
        if isinstance(error, BrokenPipeError) and _is_unread():
            _say_no_more()
            return 0
        if isinstance(error, _known_errors()):
            return _could_not(str(error))
        if os.environ.get("ROBOMESH_DEBUG"):
            raise
        return _could_not(f"a fault of robomesh itself: {error!r} (ROBOMESH_DEBUG=1 shows where)")


def _is_unread() -> bool:
    """Whether whoever read our output has gone: another pipe that breaks is a fault."""
    output = select.poll()
    output.register(1, 0)
    return any(event & select.POLLERR for _, event in output.poll(0))


def _say_no_more() -> None:
    """Let what would still be said go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _could_not(text: str) -> int:
    print(f"robomesh: {text}", file=sys.stderr)
    return 2


def _known_errors() -> tuple[type[Exception], ...]:
    from mcap_files.errors import RecordingsError
    from protocol_gateway.errors import ProtocolGatewayError
    from renderer.errors import RendererError
    from robomesh.errors import BusError
    from robots.errors import RobotError
    from services.errors import ServiceError

    return (BusError, ProtocolGatewayError, RecordingsError, RendererError, RobotError, ServiceError)


if __name__ == "__main__":
    main()
