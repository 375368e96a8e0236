"""A view token: it opens the pictures, the video and the page of one view of one robot, and nothing else.

    [[token]]
    name = "canteen"
    robot = "shanghai/pt600-1"
    view = "front"
    hash = "sha256:..."
    created = 2026-11-21T08:00:00Z
    expires = 2027-02-19T08:00:00Z    # optional

A revoked token keeps its entry, so that the console can tell a screen that still shows it from a guess.
"""

import hashlib
import hmac
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.errors import KeyNameError
from robomesh.reasons import Reason
from services.console.common.errors import AccountsError

MOST_TOKENS = 1000
_LONGEST_NAME = 32
_KEYS = frozenset({"name", "robot", "view", "hash", "created", "expires", "revoked"})
_HASH = re.compile("sha256:[0-9a-f]{64}")
# Longer texts are no tokens; they are not hashed.
_LONGEST = 128


@dataclass(frozen=True, kw_only=True)
class ViewToken:
    """An entry of the accounts file.

    Attributes:
        robot: `<site>/<robot>`.
        hash: SHA-256 of the token, which is random and therefore needs no slow hash.
        expires: None: it is valid until it is revoked.
        revoked: None: it is not revoked.
    """

    name: str
    robot: str
    view: str
    hash: str
    created: datetime
    expires: datetime | None = None
    revoked: datetime | None = None

    def ended(self, now: datetime) -> Reason | None:
        """Return why it is no longer valid; None: it is."""
        if self.revoked is not None:
            return codes.TOKEN_REVOKED(token=self.name)
        if self.expires is not None and now >= self.expires:
            return codes.TOKEN_EXPIRED(token=self.name)
        return None


def new_token() -> tuple[str, str]:
    """Return a new token and its hash."""
    token = secrets.token_urlsafe(32)
    return token, hash_of(token)


def hash_of(token: str) -> str:
    """Return the stored form of a token."""
    return f"sha256:{hashlib.sha256(token.encode(errors='replace')).hexdigest()}"


def find_token(tokens: Mapping[str, ViewToken], token: str) -> ViewToken | None:
    """Return the entry of a token, in a time that does not depend on it."""
    if len(token) > _LONGEST:
        return None
    hashed, found = hash_of(token), None
    for each in tokens.values():
        if hmac.compare_digest(each.hash, hashed):
            found = each
    return found


def check_token_scope(name: str, robot: str, view: str) -> None:
    """Check a token's name, robot (`<site>/<robot>`) and view.

    Raises:
        AccountsError: If one is invalid.
    """
    site, _, own = robot.partition("/")
    try:
        keys.check_name(name, "token")
        keys.check_name(site, "site")
        keys.check_name(own, "robot")
        keys.check_chunk(view, "view")
    except KeyNameError as error:
        raise AccountsError(str(error)) from None
    if len(name) > _LONGEST_NAME:
        raise AccountsError(f"token name {name!r}: at most {_LONGEST_NAME} characters")


def parse_token(row: Any) -> ViewToken:
    """Return the token of a `[[token]]` table.

    Raises:
        AccountsError: With what is wrong, never with the hash.
    """
    if not isinstance(row, dict):
        raise AccountsError("write [[token]], with two brackets")
    if unknown := sorted(row.keys() - _KEYS):
        raise AccountsError(f"{unknown[0]} is not a key of a token: there are {', '.join(sorted(_KEYS))}")
    for key in ("name", "robot", "view"):
        if not isinstance(row.get(key), str):
            raise AccountsError(f"{key} = {row.get(key)!r}: should be text in quotes")
    if not isinstance(row.get("hash"), str) or not _HASH.fullmatch(row["hash"]):
        raise AccountsError("hash: should be sha256, as `robomesh accounts tokens add` writes it")
    for key in ("created", "expires", "revoked"):
        time = row.get(key)
        missing = time is None and key != "created"
        if not missing and (not isinstance(time, datetime) or time.tzinfo is None):
            raise AccountsError(f"{key} = {time}: should be a time with its zone, as 2026-11-21T08:00:00Z")
    check_token_scope(row["name"], row["robot"], row["view"])
    return ViewToken(**row)


def token_lines(token: ViewToken) -> list[str]:
    """Return a token's table, as lines of TOML."""
    # None of these values contains a character that TOML would escape.
    texts = {"name": token.name, "robot": token.robot, "view": token.view, "hash": token.hash}
    times = {"created": token.created, "expires": token.expires, "revoked": token.revoked}
    return [
        "[[token]]",
        *(f'{key} = "{text}"' for key, text in texts.items()),
        *(f"{key} = {utc(time)}" for key, time in times.items() if time is not None),
    ]


def utc(time: datetime) -> str:
    """Return a time as TOML, with Z for UTC."""
    return time.isoformat().replace("+00:00", "Z")
