"""`robomesh recordings` and `robomesh audit`: what is kept of what was done.

Everything heavy is imported by the command that needs it.
"""

from pathlib import Path
from typing import Annotated

import typer

from robomesh.endpoints import DEFAULT_ROUTER
from services.command_line.options import Connect, Json

recordings_app = typer.Typer(help="What is recorded.", no_args_is_help=True)
audit_app = typer.Typer(help="The gateway's audit log.", no_args_is_help=True)


File = Annotated[Path, typer.Argument(metavar="FILE.mcap")]
Recording = Annotated[
    str, typer.Argument(metavar="FILE.mcap|[SITE/]NAME", help="A file here, or what list names.")
]


@recordings_app.command("list")
def recordings_list(connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """Every recording of every site, the newest first."""
    from services.command_line.recordings import listing

    listing.list_all(connect, as_json)


@recordings_app.command("info")
def recordings_info(what: Recording, connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """What a recording holds: topics, counts, losses, attachments."""
    from services.command_line.recordings import listing

    listing.info(what, connect, as_json)


@recordings_app.command("recover")
def recordings_recover(file: File, as_json: Json = False) -> None:
    """Make a recording whole whose writer was killed; a recorder does so itself when it starts."""
    from services.command_line.recordings import recover

    recover.run(file, as_json)


@recordings_app.command("play")
def recordings_play(
    what: Recording,
    speed: Annotated[float, typer.Option(help="0.1 to 100")] = 1.0,
    at: Annotated[float, typer.Option(metavar="SECONDS", help="Begin there.")] = 0.0,
    loop: Annotated[bool, typer.Option("--loop", help="Again and again.")] = False,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Play a recording back as a robot of its own, replay-..., until Ctrl-C."""
    from robomesh.schemas.robomesh_pb2 import PlayRequest
    from services.command_line.recordings import play

    play.run(what, PlayRequest(speed=speed, position_s=at, loop=loop), connect)


@recordings_app.command("export")
def recordings_export(
    what: Recording,
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help=".csv: joints and tool; .mp4: video; .png .pdf .svg: plots")
    ],
    begin: Annotated[float, typer.Option("--from", metavar="SECONDS", help="Since its start.")] = 0.0,
    end: Annotated[float | None, typer.Option("--to", metavar="SECONDS", help="To its end, else.")] = None,
    view: Annotated[str, typer.Option(help="Of a video: front, top, left, free, close, ...")] = "free",
    size: Annotated[str, typer.Option(metavar="WxH", help="Of a video.")] = "1280x720",
    fps: Annotated[float, typer.Option(help="Of a video.")] = 30.0,
    samples: Annotated[int, typer.Option(help="Of a video's anti-aliasing: 0, 2, 4, 8.")] = 4,
    recorded: Annotated[
        str, typer.Option(metavar="VIEW", help="Video as it was recorded, not rendered afresh.")
    ] = "",
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Make a table, a video or plots of a recording."""
    from services.command_line.recordings import export

    width, _, height = size.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise typer.BadParameter(f"--size {size}: WIDTHxHEIGHT is right, as in 1280x720")
    wanted = export.Wanted(
        begin_s=begin,
        end_s=end,
        view=view,
        size=(int(width), int(height)),
        fps=fps,
        samples=samples,
        recorded=recorded,
    )
    export.run(what, out, wanted, connect, as_json)


@recordings_app.command("fetch")
def recordings_fetch(
    what: Annotated[str, typer.Argument(metavar="[SITE/]NAME", help="What list names, or its file.")],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="A file, or a folder.")] = Path(),
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """Fetch a recording from its site; asked again, it goes on where it was broken off."""
    from services.command_line.recordings import fetch

    fetch.run(what, out, connect, as_json)


@audit_app.command("verify")
def audit_verify(
    file: Annotated[Path, typer.Argument(metavar="FILE")],
    head: Annotated[str, typer.Option(metavar="HASH", help="The last entry's hash, where you have it.")] = "",
    recording: Annotated[
        Path | None, typer.Option(metavar="REC.mcap", help="A recording that holds the hash, instead.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Whether an audit log is whole and unchanged, older parts beside it and all."""
    from services.command_line.audit import commands

    commands.verify(file, head, recording, as_json)


@audit_app.command("list")
def audit_list(
    robot: Annotated[str, typer.Argument(metavar="[ROBOT]", help="Of all; or FILE.jsonl, a log.")] = "",
    operator: Annotated[str, typer.Option(help="Who asked.")] = "",
    request: Annotated[str, typer.Option(help="stop, acquire, home, move_absolute, ...")] = "",
    outcome: Annotated[str, typer.Option(help="accepted, refused, failed")] = "",
    since: Annotated[str, typer.Option(metavar="TIME", help="RFC 3339, 15:04, or 10m (ago)")] = "",
    until: Annotated[str, typer.Option(metavar="TIME", help="the same")] = "",
    most: Annotated[int, typer.Option(metavar="N", help="The newest so many.")] = 100,
    connect: Connect = DEFAULT_ROUTER,
    as_json: Json = False,
) -> None:
    """What was asked of robots, by whom, and what became of it."""
    from services.command_line.audit import commands

    commands.list_(
        robot,
        connect,
        operator=operator,
        request=request,
        outcome=outcome,
        since=since,
        until=until,
        most=most,
        as_json=as_json,
    )
