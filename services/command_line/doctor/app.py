"""`robomesh doctor`: the command."""

from typing import Annotated

import typer

from services.command_line.keys.certificates import KeysFolder, keys_folder
from services.command_line.terminal.options import Json, SiteFile, command_group

app = command_group()


@app.command()
def doctor(
    security: Annotated[
        bool, typer.Option("--security", help="Try every role against every key, on the live mesh.")
    ] = False,
    folder: KeysFolder = None,
    routers: Annotated[
        str,
        typer.Option("--connect", metavar="tls/HOST:PORT", help="A router; else those of principals.toml."),
    ] = "",
    site: SiteFile = None,
    as_json: Json = False,
) -> int | None:
    """Check this machine, and say how to fix what is missing."""
    if security:
        from robomesh.texts import split_commas
        from services.command_line.doctor import security as check

        return check.run(keys_folder(folder, quiet=as_json), split_commas(routers), as_json)
    from services.command_line.doctor import machine as command

    command.run(site, as_json)
    return None
