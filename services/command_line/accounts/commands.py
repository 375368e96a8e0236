"""`robomesh accounts`: who may sign in to a console.

A password comes from the terminal or from standard input, never from the command line, where every
process of the machine could read it.
"""

import getpass
import json
import sys
import tomllib
from pathlib import Path

from robots.bounded_toml import read_toml
from services.console.accounts.auth_service import change_account
from services.console.accounts.file import check_account_name, read_accounts, role_of
from services.console.accounts.passwords import check_password, hash_password
from services.console.errors import AccountsError


def add(where: Path, name: str, role: str) -> None:
    """A new account; the file is made if need be."""
    path, site = _file(where)
    check_account_name(name)
    wanted = role_of(role)
    if path.exists() and name in read_accounts(path):
        raise AccountsError(f"{path}: there is an account {name} already")
    change_account(path, "add", name, role=wanted, hashed=_hashed(name, site))
    print(f"{path}: {name} may sign in as {wanted.value}")


def passwd(where: Path, name: str) -> None:
    """A new password; every session of the account ends."""
    path, site = _file(where)
    _check_there(path, name)
    change_account(path, "password", name, hashed=_hashed(name, site))
    print(f"{path}: {name} has a new password")


def role(where: Path, name: str, text: str) -> None:
    """Another role, at once."""
    path, _ = _file(where)
    wanted = role_of(text)
    change_account(path, "role", name, role=wanted)
    print(f"{path}: {name} is {wanted.value} now")


def change(where: Path, name: str, action: str, done: str) -> None:
    """`remove`, `disable`, `enable`: whoever is signed in there is signed out at once."""
    path, _ = _file(where)
    change_account(path, action, name)
    print(f"{path}: {name} {done}")


def list_(where: Path, as_json: bool) -> None:
    """Every account, never a hash."""
    path, _ = _file(where)
    for account in read_accounts(path).values():
        if as_json:
            row = {"name": account.name, "role": account.role.value, "created": account.created.isoformat()}
            print(json.dumps(row | {"disabled": account.disabled}))
        else:
            state = "  disabled" if account.disabled else ""
            print(f"{account.name:<32}  {account.role.value:<8}  since {account.created:%Y-%m-%d}{state}")


def _file(where: Path) -> tuple[Path, str]:
    """The accounts file, and the site where it is known: of a site file, the one that it names."""
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


def _check_there(path: Path, name: str) -> None:
    accounts = read_accounts(path)
    if name not in accounts:
        raise AccountsError(
            f"{path}: there is no account {name!r}: there are {', '.join(accounts) or 'none'}"
        )


def _hashed(name: str, site: str) -> str:
    if sys.stdin.isatty():
        password = check_password(getpass.getpass(f"Password of {name}: "), name=name, site=site)
        if getpass.getpass("Again: ") != password:
            raise AccountsError("these were two different passwords: nothing was changed")
    else:
        line = sys.stdin.readline()
        if not line:
            raise AccountsError("no password on standard input: one line of it is read")
        password = check_password(line.rstrip("\r\n"), name=name, site=site)
    return hash_password(password)
