"""The accounts of a console: a TOML file with a name, a role and a password's hash each.

    [[account]]
    name = "li"
    role = "operator"
    hash = "$argon2id$..."
    created = 2026-11-21T08:00:00Z

Written in one step, readable by its owner alone; whoever changes it holds a lock beside it, so that
the command line and the page's administrators lose nothing of each other.
"""

import fcntl
import os
import stat
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from enum import Enum
from pathlib import Path
from typing import Any

from robomesh import keys
from robomesh.atomic_write import write_atomically
from robomesh.errors import KeyNameError
from robots.bounded_toml import read_toml
from services.console.errors import AccountsError

_LONGEST_NAME = 32
MOST_ACCOUNTS = 1000
_KEYS = frozenset({"name", "role", "hash", "created", "disabled"})


class AccountRole(Enum):
    """What an account may do; each role may what those before it may."""

    MONITOR = "monitor"
    OPERATOR = "operator"
    ADMIN = "admin"


@dataclass(frozen=True, kw_only=True)
class Account:
    """Somebody who may sign in.

    Attributes:
        hash: Of the password, argon2id in its own text form.
    """

    name: str
    role: AccountRole
    hash: str
    created: datetime
    disabled: bool = False

    @property
    def may_command(self) -> bool:
        """Whether its role may ask for control, and change what is recorded or defined."""
        return self.role is not AccountRole.MONITOR


Accounts = Mapping[str, Account]


def check_account_name(name: str) -> str:
    """The name itself, where an account may have it: with a dot and the site it is an operator's name.

    Raises:
        AccountsError: If it may not.
    """
    try:
        keys.check_name(name, "account")
    except KeyNameError as error:
        raise AccountsError(str(error), "name") from None
    if len(name) > _LONGEST_NAME:
        raise AccountsError(f"account {name!r}: {_LONGEST_NAME} characters at most", "name")
    return name


def role_of(text: str) -> AccountRole:
    """A role by its name.

    Raises:
        AccountsError: If there is none of that name.
    """
    try:
        return AccountRole(text)
    except ValueError:
        there_are = ", ".join(role.value for role in AccountRole)
        raise AccountsError(f"role {text!r}: there are {there_are}") from None


def read_accounts(path: Path) -> dict[str, Account]:
    """The accounts of a file, by name.

    Raises:
        AccountsError: File, place and what would be right.
    """
    try:
        values = read_toml(path)
    except FileNotFoundError:
        raise AccountsError(
            f"{path}: no such file: make it with `robomesh accounts add {path} NAME --role admin`"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise AccountsError(f"{path}: cannot be read: {reason}") from None
    except tomllib.TOMLDecodeError as error:
        raise AccountsError(f"{path}: not TOML: {error}") from None
    rows = values.pop("account", [])
    if values or not isinstance(rows, list):
        raise AccountsError(f"{path}: an accounts file has [[account]] tables and nothing else")
    if len(rows) > MOST_ACCOUNTS:
        raise AccountsError(f"{path}: {len(rows)} accounts: {MOST_ACCOUNTS} at most")
    accounts: dict[str, Account] = {}
    for number, row in enumerate(rows, 1):
        try:
            account = _account(row)
        except AccountsError as error:
            raise AccountsError(f"{path}: account {number}: {error}") from None
        if account.name in accounts:
            raise AccountsError(f"{path}: two accounts are named {account.name!r}")
        accounts[account.name] = account
    return accounts


def _account(row: Any) -> Account:
    if not isinstance(row, dict):
        raise AccountsError("write [[account]], with two brackets")
    if unknown := sorted(row.keys() - _KEYS):
        raise AccountsError(f"{unknown[0]} is not a key of an account: there are {', '.join(sorted(_KEYS))}")
    name, created, disabled = row.get("name"), row.get("created"), row.get("disabled", False)
    if not isinstance(name, str):
        raise AccountsError(f"name = {name!r}: should be text in quotes")
    hashed = row.get("hash")
    # Its value is shown to nobody, not even where it is wrong.
    if not isinstance(hashed, str) or not hashed.startswith("$argon2id$") or not hashed.isascii():
        raise AccountsError("hash: should be argon2id, as `robomesh accounts passwd` writes it")
    if not isinstance(created, datetime) or created.tzinfo is None:
        raise AccountsError(f"created = {created}: should be a time with its zone, as 2026-11-21T08:00:00Z")
    if not isinstance(disabled, bool):
        raise AccountsError(f"disabled = {disabled!r}: should be true or false")
    return Account(
        name=check_account_name(name),
        role=role_of(str(row.get("role"))),
        hash=hashed,
        created=created,
        disabled=disabled,
    )


@contextmanager
def changing(path: Path) -> Iterator[dict[str, Account]]:
    """The accounts of a file, to be changed in place; written when the block ends without an error.

    Raises:
        AccountsError: If the file is wrong, or cannot be written; what was there stays.
    """
    try:
        lock = os.open(path.with_name(f".{path.name}.lock"), os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise AccountsError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        accounts = read_accounts(path) if path.exists() else {}
        yield accounts
        _write(path, accounts)
    finally:
        os.close(lock)


def _write(path: Path, accounts: Accounts) -> None:
    lines = ["# Accounts of a console: change them with `robomesh accounts`. Taken up while it runs."]
    for account in accounts.values():
        created = account.created.isoformat().replace("+00:00", "Z")
        # None of these can hold anything that TOML would need escaped.
        lines += ["", "[[account]]", f'name = "{account.name}"', f'role = "{account.role.value}"']
        lines += [f'hash = "{account.hash}"', f"created = {created}"]
        lines += ["disabled = true"] if account.disabled else []
    try:
        write_atomically(path, "\n".join([*lines, ""]).encode())
    except OSError as error:
        raise AccountsError(f"{path}: cannot be written: {error.strerror}") from None


def open_to_others(path: Path) -> bool:
    """Whether others of this machine may read the file."""
    try:
        return bool(path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO))
    except OSError:
        return False
