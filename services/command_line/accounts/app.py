"""The commands of `robomesh accounts`; what they do is imported when they do it."""

from pathlib import Path
from typing import Annotated

import typer

from services.command_line.options import Json

accounts_app = typer.Typer(help="Who may sign in to a console.", no_args_is_help=True)

Where = Annotated[
    Path, typer.Argument(metavar="FILE|SITE.toml", help="An accounts file, or a site file that names one.")
]
Name = Annotated[str, typer.Argument(metavar="NAME", help="Lower-case letters, digits, '_' and '-'.")]
Role = Annotated[str, typer.Argument(metavar="ROLE", help="monitor, operator, admin")]


@accounts_app.command("add")
def add(
    where: Where, name: Name, role: Annotated[str, typer.Option(help="monitor, operator, admin")] = "monitor"
) -> None:
    """Add an account; asks for the password, or reads a line of standard input."""
    from services.command_line.accounts import commands

    commands.add(where, name, role)


@accounts_app.command("list")
def list_(where: Where, as_json: Json = False) -> None:
    """Every account and its role."""
    from services.command_line.accounts import commands

    commands.list_(where, as_json)


@accounts_app.command("passwd")
def passwd(where: Where, name: Name) -> None:
    """Change a password; asks for it, or reads a line of standard input."""
    from services.command_line.accounts import commands

    commands.passwd(where, name)


@accounts_app.command("role")
def role(where: Where, name: Name, role: Role) -> None:
    """Change a role; it holds at once."""
    from services.command_line.accounts import commands

    commands.role(where, name, role)


@accounts_app.command("disable")
def disable(where: Where, name: Name) -> None:
    """Sign an account out, and let it in no more until it is enabled."""
    from services.command_line.accounts import commands

    commands.change(where, name, "disable", "is disabled")


@accounts_app.command("enable")
def enable(where: Where, name: Name) -> None:
    """Let a disabled account in again."""
    from services.command_line.accounts import commands

    commands.change(where, name, "enable", "may sign in again")


@accounts_app.command("remove")
def remove(where: Where, name: Name) -> None:
    """Take an account away, and sign it out."""
    from services.command_line.accounts import commands

    commands.change(where, name, "remove", "is removed")
