"""Commands of `robomesh recordings`, in the order of `--help`. `export/` does the work of `export`."""

from pathlib import Path
from typing import Annotated

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.record import changing, listing
from services.command_line.record.fetch import fetch, local_file
from services.command_line.record.listing import RecordingSource
from services.command_line.record.play import play
from services.command_line.record.recover import recover
from services.command_line.terminal.options import Connect, Json, command_group

app = command_group(
    "recordings", "Recordings: list, inspect, play, export, fetch, rename, note, tag, delete."
)


def export(
    what: RecordingSource,
    out: Annotated[
        Path,
        typer.Argument(
            metavar="OUT", help=".csv: joints and tool; .mp4: video; .png .pdf .svg: plots; .rrd: Rerun"
        ),
    ],
    begin: Annotated[float, typer.Option("--from", metavar="SECONDS", help="Since its start.")] = 0.0,
    end: Annotated[float | None, typer.Option("--to", metavar="SECONDS", help="Else to its end.")] = None,
    view: Annotated[str, typer.Option(help="Video: front, top, left, free, close, ...")] = "free",
    size: Annotated[str, typer.Option(metavar="WxH", help="Video size in pixels.")] = "1280x720",
    fps: Annotated[float, typer.Option(help="Video frame rate.")] = 30.0,
    samples: Annotated[int, typer.Option(help="Anti-aliasing of the video: 0, 2, 4, 8.")] = 4,
    recorded: Annotated[
        str, typer.Option(metavar="VIEW", help="This view's recorded video, not rendered again.")
    ] = "",
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Export a recording as a table, a video, plots, or for the Rerun viewer."""
    from services.command_line.record.export import export

    width, _, height = size.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise typer.BadParameter(f"--size {size}: must be WIDTHxHEIGHT, as in 1280x720")
    wanted = export.ExportOptions(
        begin_s=begin,
        end_s=end,
        view=view,
        size=(int(width), int(height)),
        fps=fps,
        samples=samples,
        recorded=recorded,
    )
    export.run(local_file(what, connect), out, wanted, as_json)


app.command("list")(listing.list_)
for command in (
    listing.info,
    changing.rename,
    changing.note,
    changing.tag,
    changing.delete,
    recover,
    play,
    export,
    fetch,
):
    app.command()(command)
