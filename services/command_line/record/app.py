"""`robomesh recordings`: the command group."""

from pathlib import Path
from typing import Annotated

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.terminal.options import Connect, Json, command_group

app = command_group(
    "recordings", "Recordings: list, inspect, play, export, fetch, rename, note, tag, delete."
)

_File = Annotated[Path, typer.Argument(metavar="FILE.mcap")]
_Named = Annotated[
    str, typer.Argument(metavar="[SITE/]NAME", help="A name or file from `list`; not that of several.")
]
_Operator = Annotated[str, typer.Option(help="The author's name; else yours.")]
_Recording = Annotated[
    str,
    typer.Argument(metavar="FILE.mcap|[SITE/]NAME", help="A file of this machine, or a name from `list`."),
]


@app.command("list")
def list_(
    deleted: Annotated[bool, typer.Option("--deleted", help="Deleted recordings too.")] = False,
    tag: Annotated[list[str] | None, typer.Option(metavar="TAG", help="Only with this tag.")] = None,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """List the recordings of every site, newest first."""
    from services.command_line.record import listing

    listing.list_all(connect, deleted=deleted, tags=tag or (), as_json=as_json)


@app.command()
def info(what: _Recording, connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """Show a recording's topics, message counts, losses and attachments."""
    from services.command_line.record import listing

    listing.info(what, connect, as_json)


@app.command()
def rename(
    what: _Named,
    new: Annotated[str, typer.Argument(metavar="NEW")],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Rename a recording; its file keeps its name and its bytes."""
    from services.command_line.record import changing

    changing.rename(what, new, connect, operator, as_json)


@app.command()
def note(
    what: _Named,
    text: Annotated[str, typer.Argument(metavar="TEXT", help='The note; "" removes it.')],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Write a note about a recording, in place of an earlier one."""
    from services.command_line.record import changing

    changing.note(what, text, connect, operator, as_json)


@app.command()
def tag(
    what: _Named,
    tags: Annotated[list[str], typer.Argument(metavar="TAG...")],
    remove: Annotated[bool, typer.Option("--remove", help="Remove these tags.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Add tags to a recording, or remove them."""
    from services.command_line.record import changing

    changing.tag(what, tags, connect, operator, remove=remove, as_json=as_json)


@app.command()
def delete(
    what: _Named,
    reason: Annotated[str, typer.Option(help="The reason, which every operator sees.")],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Delete a recording's file for good; who, when, why and its SHA-256 are kept."""
    from services.command_line.record import changing

    changing.delete(what, reason, connect, operator, as_json)


@app.command()
def recover(file: _File, as_json: Json = False) -> None:
    """Complete a recording whose writer was killed; a recorder does this when it starts."""
    from services.command_line.record import recover

    recover.run(file, as_json)


@app.command()
def play(
    what: _Recording,
    speed: Annotated[float, typer.Option(help="0.1 to 100")] = 1.0,
    at: Annotated[float, typer.Option(metavar="SECONDS", help="Start position.")] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", help="Repeat.")] = False,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Play a recording as a separate robot, replay-..., until Ctrl-C."""
    from robomesh.schemas.robomesh_pb2 import PlayRequest
    from services.command_line.record import play

    play.run(what, PlayRequest(speed=speed, position_s=at, loop=loop), connect)


@app.command()
def export(
    what: _Recording,
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
    from services.command_line.record.fetch import local_file

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


@app.command()
def fetch(
    what: Annotated[str, typer.Argument(metavar="[SITE/]NAME", help="A name or file from `list`.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A file, or a folder.")] = Path(),
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Fetch a recording from its site; a repeated fetch resumes."""
    from services.command_line.record import fetch

    fetch.run(what, out, connect, as_json)
