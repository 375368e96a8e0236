"""The accounts file of a command: given itself, or named by a site file."""

import tomllib
from pathlib import Path
from typing import Annotated

import typer

from robots.schema.bounded_toml import read_toml
from services.console.common.errors import AccountsError

Where = Annotated[
    Path, typer.Argument(metavar="FILE|SITE.toml", help="An accounts file, or a site file that names one.")
]


def accounts_file(where: Path) -> tuple[Path, str]:
    """Return the accounts file, given or named by a site file, and the site's name or an empty string."""
    try:
        values = read_toml(where) if where.exists() else {}
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise AccountsError(f"{where}: cannot be read: {error}") from None
    if "site" not in values:
        return where, ""
    console = values.get("console")
    named = console.get("accounts") if isinstance(console, dict) else None
    if not isinstance(named, str):
        raise AccountsError(
            f'{where}: its console has no accounts: write [console] accounts = "accounts.toml"'
        )
    return where.parent / named, str(values["site"])
