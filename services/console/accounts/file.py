"""The accounts of a console: a TOML file with a name, a role and a password hash for each, and view tokens.

    [[account]]
    name = "li"
    role = "operator"
    hash = "$argon2id$..."
    created = 2026-11-21T08:00:00Z

View tokens are in `[[token]]` tables (`view_token.py`). The file is written atomically and readable by its
owner only. Changes hold a lock file next to it, so that the command line and the page's administrators do not
overwrite each other's changes.
"""

import fcntl
import os
import stat
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.errors import KeyNameError
from robomesh.files.atomic_write import write_atomically
from robots.schema.bounded_toml import read_toml
from services.console.accounts.view_token import MOST_TOKENS, ViewToken, parse_token, token_lines, utc
from services.console.common.errors import AccountsError

Row = TypeVar("Row", "Account", ViewToken)

_LONGEST_NAME = 32
MOST_ACCOUNTS = 1000
_KEYS = frozenset({"name", "role", "hash", "created", "disabled"})
_CONTENTS = "an accounts file has [[account]] and [[token]] tables and nothing else"


class AccountRole(Enum):
    """Rights of an account; each role has those of the roles before it."""

    MONITOR = "monitor"
    OPERATOR = "operator"
    ENGINEER = "engineer"
    ADMIN = "admin"


@dataclass(frozen=True, kw_only=True)
class Account:
    """An account for sign-in.

    Attributes:
        hash: Hash of the password, in argon2id's text form.
    """

    name: str
    role: AccountRole
    hash: str
    created: datetime
    disabled: bool = False

    @property
    def may_command(self) -> bool:
        """True if its role may request control, and change what is recorded or defined."""
        return self.role is not AccountRole.MONITOR

    @property
    def may_change_cells(self) -> bool:
        """True if its role may change what stands in a cell."""
        return self.role in (AccountRole.ENGINEER, AccountRole.ADMIN)


Accounts = Mapping[str, Account]


@dataclass(frozen=True)
class AccountsFile:
    """What the file has, by name."""

    accounts: dict[str, Account] = field(default_factory=dict)
    tokens: dict[str, ViewToken] = field(default_factory=dict)


def check_account_name(name: str) -> str:
    """Return the name if it is valid for an account: `<name>.<site>` is an operator's name.

    Raises:
        AccountsError: If it is not.
    """
    reason = codes.ACCOUNT_NAME(name=name, most=_LONGEST_NAME)
    try:
        keys.check_name(name, "account")
    except KeyNameError:
        raise AccountsError(reason) from None
    if len(name) > _LONGEST_NAME:
        raise AccountsError(reason)
    return name


def role_of(text: str) -> AccountRole:
    """Return the role with a name.

    Raises:
        AccountsError: If the role does not exist.
    """
    try:
        return AccountRole(text)
    except ValueError:
        roles = ", ".join(role.value for role in AccountRole)
        raise AccountsError(codes.ACCOUNT_ROLE(role=text, roles=roles)) from None


def read_accounts(path: Path) -> AccountsFile:
    """Read an accounts file.

    Raises:
        AccountsError: With the file, the place and what would be right.
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
    found = AccountsFile()
    accounts, tokens = values.pop("account", []), values.pop("token", [])
    _read_rows(path, "account", accounts, _account, found.accounts, MOST_ACCOUNTS)
    _read_rows(path, "token", tokens, parse_token, found.tokens, MOST_TOKENS)
    if values:
        raise AccountsError(f"{path}: {_CONTENTS}")
    return found


def _read_rows(
    path: Path, kind: str, rows: Any, parse: Callable[[Any], Row], into: dict[str, Row], most: int
) -> None:
    if not isinstance(rows, list):
        raise AccountsError(f"{path}: {_CONTENTS}")
    if len(rows) > most:
        raise AccountsError(f"{path}: {len(rows)} {kind}s: {most} at most")
    for number, row in enumerate(rows, 1):
        try:
            parsed = parse(row)
        except AccountsError as error:
            raise AccountsError(f"{path}: {kind} {number}: {error}") from None
        if parsed.name in into:
            raise AccountsError(f"{path}: two {kind}s are named {parsed.name!r}")
        into[parsed.name] = parsed


def _account(row: Any) -> Account:
    if not isinstance(row, dict):
        raise AccountsError("write [[account]], with two brackets")
    if unknown := sorted(row.keys() - _KEYS):
        raise AccountsError(f"{unknown[0]} is not a key of an account: there are {', '.join(sorted(_KEYS))}")
    name, created, disabled = row.get("name"), row.get("created"), row.get("disabled", False)
    if not isinstance(name, str):
        raise AccountsError(f"name = {name!r}: should be text in quotes")
    hashed = row.get("hash")
    # Errors never contain the hash, not even an invalid one.
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
def changing(path: Path) -> Iterator[AccountsFile]:
    """Yield the contents of a file for changes; write them when the block ends without an error.

    Raises:
        AccountsError: If the file is invalid or cannot be written; the old file remains.
    """
    try:
        lock = os.open(path.with_name(f".{path.name}.lock"), os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise AccountsError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        found = read_accounts(path) if path.exists() else AccountsFile()
        yield found
        _write(path, found)
    finally:
        os.close(lock)


def _write(path: Path, found: AccountsFile) -> None:
    lines = ["# Accounts of a console: change them with `robomesh accounts`. A running console reloads them."]
    for account in found.accounts.values():
        # None of these values contains a character that TOML would escape.
        lines += ["", "[[account]]", f'name = "{account.name}"', f'role = "{account.role.value}"']
        lines += [f'hash = "{account.hash}"', f"created = {utc(account.created)}"]
        lines += ["disabled = true"] if account.disabled else []
    for token in found.tokens.values():
        lines += ["", *token_lines(token)]
    try:
        write_atomically(path, "\n".join([*lines, ""]).encode())
    except OSError as error:
        raise AccountsError(f"{path}: cannot be written: {error.strerror}") from None


def now() -> datetime:
    """Return the time for an entry of the file."""
    return datetime.now(UTC).replace(microsecond=0)


def open_to_others(path: Path) -> bool:
    """Return whether other users of this machine may read the file."""
    try:
        return bool(path.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO))
    except OSError:
        return False
