"""The table of robomesh's commands, and the command group that imports a command when it is used.

`robomesh --help` answers from the table, without importing any command.
"""

import importlib.metadata
from importlib import import_module
from typing import Annotated, Any, NamedTuple

import typer
from typer.core import TyperCommand, TyperGroup
from typer.main import get_command

from services.command_line.terminal.output import print_line


class Row(NamedTuple):
    """A row of the table.

    Attributes:
        module: Module of this package; its Typer `app` is the command group, or holds the command.
        help: First sentence of the command's own help; a test compares the two.
    """

    module: str
    help: str


COMMANDS = {
    "up": Row("site.app", "Run a whole site; without a file, the built-in one with a simulated arm."),
    "router": Row("site.app", "Run a site's router."),
    "gateway": Row("site.app", "Put the site's controllers on the mesh."),
    "kinematics": Row("site.app", "Publish what the robots are and where their links are."),
    "recorder": Row("site.app", "Record robots on request."),
    "player": Row("site.app", "Play recordings back as separate robots."),
    "renderer": Row("site.app", "Draw the robots off screen and publish video."),
    "console": Row("site.app", "Serve the page."),
    "watch": Row("site.app", "Hold the site's alarms, and check presence, clocks, versions and names."),
    "store": Row("site.app", "Store the site's programs with all their versions."),
    "metrics": Row("site.app", "Print a Prometheus configuration that scrapes every service of a site."),
    "simulate": Row(
        "site.simulate", "Run a simulated controller of any kind that a site file's `protocol` can name."
    ),
    "foxglove": Row(
        "site.bridges", "Serve Foxglove and Lichtblick on a Foxglove WebSocket, ws://127.0.0.1:8765."
    ),
    "ros2": Row("site.bridges", "Publish the robots to ROS 2 nodes with rmw_zenoh."),
    "list": Row(
        "watch.listing", "List sites, robots and services, with monitors, control, ages and round trips."
    ),
    "monitor": Row("watch.monitor", "Watch a robot in the terminal."),
    "signals": Row(
        "watch.signals",
        "Print what a robot's controller reports in addition to joints: I/O, currents, program, modes.",
    ),
    "send": Row("control.send", "Send a command to a robot and wait until it ends; Ctrl-C stops the robot."),
    "fault": Row("control.fault", "Make a simulated controller misbehave: freeze, flood, jump, ..."),
    "snapshot": Row("watch.snapshot", "Save a rendered picture of a robot."),
    "video": Row("watch.video", "Save rendered video of a robot, playable while it is written."),
    "record": Row("record.record", "Record a robot until Ctrl-C."),
    "alive": Row("watch.alive", "Check that a service answers: exit status 0 or 1, for health checks."),
    "doctor": Row("doctor.app", "Check this machine, and say how to fix what is missing."),
    "version": Row(
        "doctor.version", "Print the version of robomesh; --all: all that a report of a fault needs."
    ),
    "fk": Row(
        "robots.kinematics", 'Forward kinematics: {"joints": [..]} a line in, {"tool", "links"} a line out.'
    ),
    "ik": Row(
        "robots.kinematics",
        'Inverse kinematics of a pose; JSON: {"pose", "task", "near", "all", "seed"} a line in.',
    ),
    "robot": Row("robots.commands", "Robot descriptions: check, show, import, export, verify."),
    "shapes": Row("robots.shapes", "Files with shapes: inspect, convert."),
    "program": Row("program.commands", "Teach programs: check, plan, from CAD."),
    "programs": Row(
        "program.stored", "Programs stored at a site: list, show, save, restore, diff, export, import."
    ),
    "probe": Row("doctor.probe", "Show which protocol a controller's port speaks."),
    "note": Row("record.note", "Write a note on a robot's time, list its notes, or withdraw one."),
    "cell": Row("control.cell", "Fixtures and the floor of a robot's cell: show, set, move, undo."),
    "recordings": Row(
        "record.app", "Recordings: list, inspect, play, export, fetch, rename, note, tag, delete."
    ),
    "audit": Row("record.audit", "The gateway's audit log."),
    "alarms": Row("watch.alarms", "Alarms: list, acknowledge, shelve."),
    "keys": Row("keys.certificates", "A site's certificates: who may take part, in which role."),
    "accounts": Row("keys.accounts", "Accounts that may sign in to a console."),
}


# Earlier names, valid for one release.
_RENAMED = {"mesh": "shapes"}


class _LazyGroup(TyperGroup):
    """A command group with a placeholder for each row: enough for help and for suggestions."""

    def resolve_command(self, ctx: Any, args: list[str]) -> tuple[str | None, Any, list[str]]:
        name, _, rest = super().resolve_command(ctx, [_RENAMED.get(args[0], args[0]), *args[1:]])
        return name, None if name is None else load(name), rest

    def get_help_option(self, ctx: Any) -> Any:
        option = super().get_help_option(ctx)
        if option is not None:
            # Typer converts a default of None with pydantic, whose import takes 0.2 s.
            option.default = False
        return option


def load(name: str) -> Any:
    """Import a command or command group, with `--keys FILE` wherever there is `--connect`."""
    # Not at the top: its imports would double the time of `robomesh --help`.
    from services.command_line.terminal.connection_options import offer_keys

    app = import_module(f"services.command_line.{COMMANDS[name].module}").app
    found: Any = get_command(app)
    if app.info.name != name:
        # Typer makes an app with a single command that command.
        found = getattr(found, "commands", {name: found})[name]
    return offer_keys(found)


def root() -> TyperGroup:
    """Return `robomesh` itself."""
    return _LazyGroup(
        name="robomesh",
        help="A service mesh that puts industrial robot arms on the network.",
        params=_options(),
        commands={
            # Only a `short_help` wraps; typer cuts a `help` to one line.
            name: TyperCommand(name=name, help=row.help, short_help=row.help, rich_markup_mode=None)
            for name, row in COMMANDS.items()
        },
        no_args_is_help=True,
        rich_markup_mode=None,
    )


def _options() -> list[Any]:
    """Return the options of `robomesh` itself, taken from a command that Typer makes with them alone."""
    app = typer.Typer()

    @app.command()
    def only(
        version: Annotated[
            bool,
            typer.Option(
                "--version",
                is_eager=True,
                expose_value=False,
                callback=_print_version,
                help="Print the version and exit.",
            ),
        ] = False,
    ) -> None: ...

    options = [each for each in get_command(app).params if each.name != "help"]
    for option in options:
        # As in `get_help_option`.
        option.default = False
    return options


def _print_version(asked: bool) -> None:
    if asked:
        print_line(f"robomesh {importlib.metadata.version('robomesh')}")
        raise typer.Exit
