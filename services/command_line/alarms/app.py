"""`robomesh alarms`: what a person must act on."""

from typing import Annotated

import typer

from robomesh.endpoints import DEFAULT_ROUTER
from services.command_line.options import Connect, Json

alarms_app = typer.Typer(help="Alarms: list, acknowledge, shelve.", no_args_is_help=True)

_Ids = Annotated[list[str], typer.Argument(metavar="ID...", help="As `alarms list` or the page shows them.")]
_Operator = Annotated[str, typer.Option(help="In whose name.")]


@alarms_app.command("list")
def list_(connect: Connect = DEFAULT_ROUTER, as_json: Json = False) -> None:
    """All that are not over and seen, of every site, most urgent first."""
    from services.command_line.alarms import commands

    commands.print_list(connect, as_json)


@alarms_app.command()
def ack(
    ids: Annotated[
        list[str],
        typer.Argument(metavar="ID...", help="As `alarms list` or the page shows them; all: every one."),
    ],
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Say that you have seen alarms."""
    from services.command_line.alarms import commands

    commands.acknowledge(ids, connect, operator, as_json)


@alarms_app.command()
def shelve(
    ids: _Ids,
    reason: Annotated[str, typer.Option(help="Why; everybody sees it.")],
    for_: Annotated[str, typer.Option("--for", metavar="30m|8h", help="How long; at most a day.")] = "1h",
    connect: Connect = DEFAULT_ROUTER,
    operator: _Operator = "",
    as_json: Json = False,
) -> None:
    """Put alarms aside for a while."""
    from services.command_line.alarms import commands

    commands.shelve(ids, for_, reason, connect, operator, as_json)


@alarms_app.command()
def unshelve(
    ids: _Ids, connect: Connect = DEFAULT_ROUTER, operator: _Operator = "", as_json: Json = False
) -> None:
    """Take alarms back from the shelf."""
    from services.command_line.alarms import commands

    commands.unshelve(ids, connect, operator, as_json)
