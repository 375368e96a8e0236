"""Arguments and options that several commands take, and the style of every command group."""

from pathlib import Path
from typing import Annotated

import typer

from services.command_line.terminal.completion import robot_names

SiteFile = Annotated[Path | None, typer.Option("--site", metavar="SITE.toml", help="The site file.")]
Connect = Annotated[
    str,
    typer.Option(
        metavar="tcp/HOST:PORT",
        envvar="ROBOMESH_CONNECT",
        help="The router to attach to; of several, separated by commas, the first that answers.",
    ),
]
Started = Annotated[str, typer.Option(metavar="ROBOT", help="Only this robot, started from the page.")]
Metrics = Annotated[
    str,
    typer.Option(metavar="HOST:PORT", help="Serve Prometheus there; port 0: a free port, see the log."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, in SI units.")]
Robot = Annotated[
    str, typer.Argument(metavar="ROBOT", help="robot, or site/robot", autocompletion=robot_names)
]
Width = Annotated[int, typer.Option(metavar="PX", min=0, help="Picture width; 0: the renderer's own.")]
Height = Annotated[int, typer.Option(metavar="PX", min=0, help="Picture height; 0: the renderer's own.")]


def command_group(name: str | None = None, text: str | None = None) -> typer.Typer:
    """Return a Typer app that prints plain text.

    Args:
        name: Of the command group; None: the app holds commands of the top level.
        text: The group's help.
    """
    return typer.Typer(
        name=name, help=text, no_args_is_help=True, add_completion=False, rich_markup_mode=None
    )
