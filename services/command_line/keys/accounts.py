"""`robomesh accounts`: accounts that may sign in to a console.

A password comes from the terminal or from standard input, never from the command line, where every
process of the machine could read it.
"""

import getpass
import sys
from pathlib import Path
from typing import Annotated

import typer

from services.command_line.keys import account_tokens
from services.command_line.keys.accounts_file import Where, accounts_file
from services.command_line.terminal.options import Json, command_group
from services.command_line.terminal.output import print_json, print_line
from services.console.accounts.auth_service import change_account
from services.console.accounts.file import check_account_name, read_accounts, role_of
from services.console.accounts.passwords import check_password, hash_password
from services.console.common.errors import AccountsError

app = command_group("accounts", "Accounts that may sign in to a console.")
app.add_typer(account_tokens.app)

_Name = Annotated[str, typer.Argument(metavar="NAME", help="Lower-case letters, digits, '_' and '-'.")]


@app.command()
def add(
    where: Where,
    name: _Name,
    role: Annotated[str, typer.Option(help="monitor, operator, engineer, admin")] = "monitor",
) -> None:
    """Add an account; asks for the password, or reads a line of standard input."""
    path, site = accounts_file(where)
    check_account_name(name)
    wanted = role_of(role)
    if path.exists() and name in read_accounts(path).accounts:
        raise AccountsError(f"{path}: an account {name} exists already")
    change_account(path, "add", name, role=wanted, hashed=_hashed_password(name, site))
    print_line(f"{path}: {name} may sign in as {wanted.value}")


@app.command("list")
def list_(where: Where, as_json: Json = False) -> None:
    """List the accounts and their roles."""
    path, _ = accounts_file(where)
    for account in read_accounts(path).accounts.values():
        if as_json:
            row = {"name": account.name, "role": account.role.value, "created": account.created.isoformat()}
            print_json(row | {"disabled": account.disabled})
        else:
            state = "  disabled" if account.disabled else ""
            print_line(
                f"{account.name:<32}  {account.role.value:<8}  since {account.created:%Y-%m-%d}{state}"
            )


@app.command()
def passwd(where: Where, name: _Name) -> None:
    """Change a password and end the account's sessions; asks for it, or reads a line of standard input."""
    path, site = accounts_file(where)
    accounts = read_accounts(path).accounts
    if name not in accounts:
        raise AccountsError(f"{path}: no account {name!r}; accounts: {', '.join(accounts) or 'none'}")
    change_account(path, "password", name, hashed=_hashed_password(name, site))
    print_line(f"{path}: {name} has a new password")


@app.command()
def role(
    where: Where,
    name: _Name,
    role: Annotated[str, typer.Argument(metavar="ROLE", help="monitor, operator, engineer, admin")],
) -> None:
    """Change an account's role, effective immediately."""
    path, _ = accounts_file(where)
    wanted = role_of(role)
    change_account(path, "role", name, role=wanted)
    print_line(f"{path}: {name} is {wanted.value} now")


@app.command()
def disable(where: Where, name: _Name) -> None:
    """Sign an account out, and refuse its sign-in until it is enabled."""
    _change(where, name, "disable", "is disabled")


@app.command()
def enable(where: Where, name: _Name) -> None:
    """Allow a disabled account to sign in again."""
    _change(where, name, "enable", "may sign in again")


@app.command()
def remove(where: Where, name: _Name) -> None:
    """Remove an account, and sign it out."""
    _change(where, name, "remove", "is removed")


def _change(where: Path, name: str, action: str, done: str) -> None:
    path, _ = accounts_file(where)
    change_account(path, action, name)
    print_line(f"{path}: {name} {done}")


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
