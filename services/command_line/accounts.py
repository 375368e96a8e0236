"""`robomesh accounts`: accounts that may sign in to a console.

A password comes from the terminal or from standard input, never from the command line, where every
process of the machine could read it.
"""

import getpass
import json
import sys
import tomllib
from pathlib import Path
from typing import Annotated

import typer

from robots.bounded_toml import read_toml
from services.command_line.options import Json, command_group
from services.console.accounts.auth_service import change_account
from services.console.accounts.file import check_account_name, read_accounts, role_of
from services.console.accounts.passwords import check_password, hash_password
from services.console.errors import AccountsError

app = command_group("accounts", "Accounts that may sign in to a console.")

_Where = Annotated[
    Path, typer.Argument(metavar="FILE|SITE.toml", help="An accounts file, or a site file that names one.")
]
_Name = Annotated[str, typer.Argument(metavar="NAME", help="Lower-case letters, digits, '_' and '-'.")]


@app.command()
def add(
    where: _Where,
    name: _Name,
    role: Annotated[str, typer.Option(help="monitor, operator, admin")] = "monitor",
) -> None:
    """Add an account; asks for the password, or reads a line of standard input."""
    path, site = _accounts_file(where)
    check_account_name(name)
    wanted = role_of(role)
    if path.exists() and name in read_accounts(path):
        raise AccountsError(f"{path}: an account {name} exists already")
    change_account(path, "add", name, role=wanted, hashed=_hashed_password(name, site))
    print(f"{path}: {name} may sign in as {wanted.value}")


@app.command("list")
def list_(where: _Where, as_json: Json = False) -> None:
    """List the accounts and their roles."""
    path, _ = _accounts_file(where)
    for account in read_accounts(path).values():
        if as_json:
            row = {"name": account.name, "role": account.role.value, "created": account.created.isoformat()}
            print(json.dumps(row | {"disabled": account.disabled}))
        else:
            state = "  disabled" if account.disabled else ""
            print(f"{account.name:<32}  {account.role.value:<8}  since {account.created:%Y-%m-%d}{state}")


@app.command()
def passwd(where: _Where, name: _Name) -> None:
    """Change a password and end the account's sessions; asks for it, or reads a line of standard input."""
    path, site = _accounts_file(where)
    accounts = read_accounts(path)
    if name not in accounts:
        raise AccountsError(f"{path}: no account {name!r}; accounts: {', '.join(accounts) or 'none'}")
    change_account(path, "password", name, hashed=_hashed_password(name, site))
    print(f"{path}: {name} has a new password")


@app.command()
def role(
    where: _Where,
    name: _Name,
    role: Annotated[str, typer.Argument(metavar="ROLE", help="monitor, operator, admin")],
) -> None:
    """Change an account's role, effective immediately."""
    path, _ = _accounts_file(where)
    wanted = role_of(role)
    change_account(path, "role", name, role=wanted)
    print(f"{path}: {name} is {wanted.value} now")


@app.command()
def disable(where: _Where, name: _Name) -> None:
    """Sign an account out, and refuse its sign-in until it is enabled."""
    _change(where, name, "disable", "is disabled")


@app.command()
def enable(where: _Where, name: _Name) -> None:
    """Allow a disabled account to sign in again."""
    _change(where, name, "enable", "may sign in again")


@app.command()
def remove(where: _Where, name: _Name) -> None:
    """Remove an account, and sign it out."""
    _change(where, name, "remove", "is removed")


def _change(where: Path, name: str, action: str, done: str) -> None:
    path, _ = _accounts_file(where)
    change_account(path, action, name)
    print(f"{path}: {name} {done}")


def _accounts_file(where: Path) -> tuple[Path, str]:
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


def _hashed_password(name: str, site: str) -> str:
    if sys.stdin.isatty():
        password = check_password(getpass.getpass(f"Password of {name}: "), name=name, site=site)
        if getpass.getpass("Again: ") != password:
            raise AccountsError("the two passwords differ: nothing was changed")
    else:
        line = sys.stdin.readline()
        if not line:
            raise AccountsError("no password on standard input: write it there as one line")
        password = check_password(line.rstrip("\r\n"), name=name, site=site)
    return hash_password(password)
