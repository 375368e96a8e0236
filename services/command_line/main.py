"""`robomesh`: its commands, what they take, and how they end.

Exit status 0: done; 1: done, and the answer is no; 2: could not, and one line says why.
Everything heavy is imported by the command that needs it.
"""

import os
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.main import get_command

from bus.endpoints import DEFAULT_ROUTER

app = typer.Typer(
    name="robomesh",
    help="A service mesh that puts industrial robot arms on the network.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
robot_app = typer.Typer(help="Robot descriptions: check, show, export.", no_args_is_help=True)
mesh_app = typer.Typer(help="Mesh files: what is in one.", no_args_is_help=True)
recordings_app = typer.Typer(help="What is recorded.", no_args_is_help=True)
audit_app = typer.Typer(help="The gateway's audit log.", no_args_is_help=True)
for name, part in (
    ("robot", robot_app),
    ("mesh", mesh_app),
    ("recordings", recordings_app),
    ("audit", audit_app),
):
    app.add_typer(part, name=name)

SiteFile = Annotated[Path | None, typer.Option("--site", metavar="SITE.toml", help="The site file.")]
Connect = Annotated[str, typer.Option(metavar="tcp/HOST:PORT", help="The router to attach to.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, in SI units.")]
Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="robot, or site/robot")]


# ------------------------------------------------------------------ what runs


@app.command()
def up(
    site: Annotated[Path | None, typer.Argument(metavar="[SITE.toml]", help="The site file.")] = None,
) -> None:
    """Run a whole site; without a file, the built-in one with a simulated arm."""
    from services.command_line import up as command

    command.run(site)


@app.command()
def router(site: SiteFile = None) -> None:
    """Run a site's router."""
    from services.command_line import roles

    roles.router(site)


@app.command()
def gateway(
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
    controller: Annotated[
        list[str] | None,
        typer.Option(metavar="ROBOT=tcp://HOST:PORT", help="Where a robot's controller is, instead."),
    ] = None,
) -> None:
    """Put the site's controllers on the mesh."""
    from services.command_line import roles

    roles.gateway(site, connect, controller or [])


@app.command()
def kinematics(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER) -> None:
    """Tell what the robots are and where their parts are."""
    from services.command_line import roles

    roles.kinematics(site, connect)


@app.command()
def recorder(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER) -> None:
    """Record what is asked for."""
    from services.command_line import roles

    roles.recorder(site, connect)


@app.command()
def renderer(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER) -> None:
    """Draw the robots off screen and publish video."""
    from services.command_line import roles

    roles.renderer(site, connect)


@app.command()
def console(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER) -> None:
    """Serve the page."""
    from services.command_line import roles

    roles.console(site, connect)


@app.command()
def simulate(
    robot: Annotated[str, typer.Option(metavar="R", help="A library robot or a description.")] = "pt600",
    listen: Annotated[str, typer.Option(metavar="HOST:PORT")] = "127.0.0.1:5400",
    rate: Annotated[float, typer.Option(metavar="HZ", min=1, max=1000)] = 100.0,
    max_clients: Annotated[int, typer.Option(metavar="N", min=1)] = 8,
    demo: Annotated[bool, typer.Option(help="Move until the first command.")] = False,
    fault: Annotated[
        list[str] | None, typer.Option(metavar="NAME[@SECONDS]", help="freeze, garbage; when it begins.")
    ] = None,
    code: Annotated[
        list[str] | None,
        typer.Option(metavar="NUMBER=TYPE", help="A type code of the site file: 2=ABSOLUTE.DEG"),
    ] = None,
    insecure: Annotated[bool, typer.Option(help="Listen beyond loopback, without any protection.")] = False,
) -> None:
    """Run a controller of the old kind that simulates its arm."""
    from services.command_line import roles

    roles.simulate(robot, listen, rate, max_clients, demo, tuple(fault or ()), code or [], insecure)


# ------------------------------------------------------------- what is there


@app.command("list")
def list_(connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """Sites, robots, services, who controls, how old."""
    from services.command_line import listing

    listing.run(connect, as_json)


@app.command()
def monitor(
    robot: Robot,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
    count: Annotated[int | None, typer.Option(metavar="N", help="End after N states.")] = None,
) -> None:
    """Watch a robot in the terminal."""
    from services.command_line import monitor as command

    command.run(robot, connect, as_json, count)


@app.command(context_settings={"ignore_unknown_options": True})
def send(
    robot: Robot,
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="COMMAND",
            help="home, stop, hold, resume, reset, trace on, trace off, speed N, move Q... (degrees, mm)",
        ),
    ],
    connect: Connect = DEFAULT_ROUTER,
    operator: Annotated[str, typer.Option(help="In whose name.")] = "",
    as_json: Json = False,
) -> None:
    """Command a robot: takes control, holds it until the motion ends, gives it back; Ctrl-C stops."""
    from services.command_line import send as command

    command.run(robot, words, connect, operator, as_json)


@app.command()
def snapshot(
    robot: Robot,
    view: Annotated[str, typer.Argument(metavar="VIEW", help="front, top, left, free, ...")],
    out: Annotated[Path, typer.Argument(metavar="OUT.png")],
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Save a rendered picture of a robot."""
    from services.command_line import snapshot as command

    command.run(robot, view, out, connect)


@app.command()
def record(
    robot: Robot,
    name: Annotated[str, typer.Option(help="Of the capture.")] = "",
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Record a robot until Ctrl-C."""
    from services.command_line import recordings

    recordings.record(robot, name, connect, as_json)


@recordings_app.command("list")
def recordings_list(connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """Every recording of every site, the newest first."""
    from services.command_line import recordings

    recordings.list_all(connect, as_json)


@recordings_app.command("info")
def recordings_info(
    file: Annotated[Path, typer.Argument(metavar="FILE.mcap")], as_json: Json = False
) -> None:
    """What a recording holds: topics, counts, losses."""
    from services.command_line import recordings

    recordings.info(file, as_json)


@audit_app.command("verify")
def audit_verify(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    head: Annotated[str, typer.Option(metavar="HASH", help="The last entry's hash, where you have it.")] = "",
    as_json: Json = False,
) -> None:
    """Whether an audit log is whole and unchanged."""
    from services.command_line import audit

    audit.verify(file, head, as_json)


@app.command()
def doctor() -> None:
    """What is missing on this machine, and how to mend it."""
    from services.command_line import doctor as command

    command.run()


# ------------------------------------------------------- what a robot is


@robot_app.command("check")
def robot_check(robot: Annotated[str, typer.Argument(metavar="ROBOT")], as_json: Json = False) -> None:
    """Whether a description is right; a line a problem."""
    from services.command_line import robots

    robots.check(robot, as_json)


@robot_app.command("show")
def robot_show(robot: Annotated[str, typer.Argument(metavar="ROBOT")], as_json: Json = False) -> None:
    """A robot's joints, limits and reach."""
    from services.command_line import robots

    robots.show(robot, as_json)


@robot_app.command("export")
def robot_export(
    robot: Annotated[str, typer.Argument(metavar="ROBOT")],
    folder: Annotated[Path, typer.Argument(metavar="FOLDER")],
) -> None:
    """Write a robot as URDF with GLB meshes."""
    from services.command_line import robots

    robots.export(robot, folder)


@mesh_app.command("info")
def mesh_info(file: Annotated[Path, typer.Argument(metavar="FILE")], as_json: Json = False) -> None:
    """Triangles, bounds and materials of a mesh file, in its own units and axes."""
    from services.command_line import robots

    robots.mesh_info(file, as_json)


@app.command()
def fk(
    requests: Annotated[str, typer.Argument(metavar="-", help="JSON requests on standard input.")] = "-",
    robot: Annotated[str, typer.Option(metavar="R")] = "pt600",
) -> None:
    """Forward kinematics: {"joints": [..]} a line in, {"tool", "links"} a line out."""
    from services.command_line import robots

    robots.forward(robot, requests)


# --------------------------------------------------------------------- the end


def main() -> None:
    """The program."""
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command; the exit status."""
    try:
        outcome: Any = get_command(app).main(arguments, prog_name="robomesh", standalone_mode=False)
        return outcome if isinstance(outcome, int) else 0
    except typer.TyperException as error:
        return _could_not(
            f"{error.format_message()} ({' '.join(['robomesh', *arguments[:1]])} --help tells more)"
        )
    except (KeyboardInterrupt, typer.Abort):
        return 130
    except BrokenPipeError:
        # Whoever read our output has gone; nothing more can be said there.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        # Services run their robots in task groups.
        while isinstance(error, ExceptionGroup):
            error = error.exceptions[0]
        if isinstance(error, _known_errors()):
            return _could_not(str(error))
        if os.environ.get("ROBOMESH_DEBUG"):
            raise
        return _could_not(f"a fault of robomesh itself: {error!r} (ROBOMESH_DEBUG=1 shows where)")


def _could_not(text: str) -> int:
    print(f"robomesh: {text}", file=sys.stderr)
    return 2


def _known_errors() -> tuple[type[Exception], ...]:
    from bus.errors import BusError
    from protocol_gateway.errors import ProtocolGatewayError
    from renderer.errors import RendererError
    from robots.errors import RobotError
    from services.errors import ServiceError

    return (BusError, ProtocolGatewayError, RendererError, RobotError, ServiceError)


if __name__ == "__main__":
    main()
