"""Arguments and options that several commands take."""

from pathlib import Path
from typing import Annotated

import typer

SiteFile = Annotated[Path | None, typer.Option("--site", metavar="SITE.toml", help="The site file.")]
Connect = Annotated[
    str,
    typer.Option(
        metavar="tcp/HOST:PORT",
        envvar="ROBOMESH_CONNECT",
        help="The router to attach to; several, with a comma between: the first that answers.",
    ),
]
Started = Annotated[str, typer.Option(metavar="ROBOT", help="Only one that was started from the page.")]
Metrics = Annotated[
    str,
    typer.Option(metavar="HOST:PORT", help="Serve Prometheus there; port 0: a free one, told in the log."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, in SI units.")]
Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="robot, or site/robot")]
Width = Annotated[int, typer.Option(metavar="PX", min=0, help="Of the picture; 0: the renderer's own.")]
Height = Annotated[int, typer.Option(metavar="PX", min=0, help="Of the picture; 0: the renderer's own.")]
