"""Who is signed in: sessions by their tokens, and what ends them.

A session is for watching: it lasts while a page of it is open, a week at most, because control rooms
watch for days. The right to command is shorter: it rests half an hour after the last touch of a person,
and twelve hours after the last password, until the password is given again. Whoever has control by then
keeps it: no motion is stopped because its operator only watched.

Kept in memory: a console that starts anew asks everybody to sign in again. Times are the caller's.
"""

import asyncio
import hashlib
import secrets
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Protocol

from services.console.accounts.file import Account, Accounts

LASTS_S = 7 * 24 * 3600.0
IDLE_S = 3600.0  # without a page open, nor any request
COMMANDS_UNTOUCHED_S = 1800.0
COMMANDS_AFTER_PASSWORD_S = 12 * 3600.0
MOST_OF_ACCOUNT = 16
MOST_PAGES = 32


class Page(Protocol):
    """A page's connection, as its session knows it."""

    @property
    def in_control(self) -> bool:
        """Whether control was had through it, and not given back."""

    def rights_changed(self) -> None:
        """Told when the account may do more, or less."""


@dataclass(eq=False, kw_only=True)
class SignedIn:
    """One sign-in of an account.

    Attributes:
        account: As the accounts file has it now.
        id: For lists and events; no secret, and no way to sign in.
        resting: The right to command rests until the password is given again.
        ended: Why it is over, one word for the page; empty: it is not.
    """

    account: Account
    address: str
    agent: str
    began: datetime
    began_at: float
    password_at: float
    touched_at: float
    seen_at: float
    id: str = field(default_factory=lambda: secrets.token_hex(4))
    resting: bool = False
    ended: str = ""
    pages: set[Page] = field(default_factory=set)
    _tasks: set[asyncio.Task[Any]] = field(default_factory=set)
    # Hash of the token by which a browser is known.
    key: bytes = b""

    @property
    def may_command(self) -> bool:
        """Whether it may ask for control now."""
        return not self.ended and self.account.may_command and not self.resting

    @contextmanager
    def serving(self) -> Iterator[None]:
        """Around what the running task does for it: cancelled when the session ends."""
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        try:
            yield
        finally:
            self._tasks.discard(task)

    @contextmanager
    def with_page(self, page: Page) -> Iterator[None]:
        """Around a page's connection."""
        self.pages.add(page)
        try:
            yield
        finally:
            self.pages.discard(page)

    def end(self, why: str) -> None:
        """Everything that is done for it ends."""
        self.ended = why
        for task in tuple(self._tasks):
            task.cancel()


def key_of(token: str) -> bytes:
    """What a token is known by here: the tokens themselves are nowhere kept."""
    return hashlib.sha256(token.encode(errors="replace")).digest()


class Sessions:
    """All sessions of a console.

    Args:
        on_end: Told of each that ends.
    """

    def __init__(self, accounts: Accounts, *, on_end: Callable[[SignedIn], None] = lambda _: None) -> None:
        self.accounts = dict(accounts)
        self._on_end = on_end
        self._sessions: dict[bytes, SignedIn] = {}

    def __iter__(self) -> Iterator[SignedIn]:
        return iter(tuple(self._sessions.values()))

    def of(self, token: str, now: float) -> SignedIn | None:
        """The session of a token, if it is one."""
        found = self._sessions.get(key_of(token)) if token else None
        if found is not None:
            self._look_at(found, now)
            found.seen_at = now
        return None if found is None or found.ended else found

    def open(
        self, account: Account, *, address: str, agent: str, now: float, at: datetime
    ) -> tuple[str, SignedIn]:
        """A new session and its token; the account's least used ends where it has too many."""
        own = sorted((each for each in self if each.account.name == account.name), key=lambda s: s.seen_at)
        for old in own[: max(0, len(own) - MOST_OF_ACCOUNT + 1)]:
            self.end(old, "too_many")
        signed_in = SignedIn(
            account=account,
            address=address,
            agent=agent[:120],
            began=at,
            began_at=now,
            password_at=now,
            touched_at=now,
            seen_at=now,
        )
        return self.new_token(signed_in), signed_in

    def new_token(self, signed_in: SignedIn) -> str:
        """Another token for a session; the old one is none any more."""
        token = secrets.token_urlsafe(32)
        self._sessions.pop(signed_in.key, None)
        signed_in.key = key_of(token)
        self._sessions[signed_in.key] = signed_in
        return token

    def end(self, signed_in: SignedIn, why: str) -> None:
        """Ends a session, its pages and downloads at once."""
        if self._sessions.pop(signed_in.key, None) is not None:
            signed_in.end(why)
            self._on_end(signed_in)

    def end_all(self, name: str, why: str, *, but: SignedIn | None = None) -> None:
        """Ends every session of an account."""
        for each in self:
            if each.account.name == name and each is not but:
                self.end(each, why)

    def touched(self, signed_in: SignedIn, now: float) -> None:
        """A person did something on a page of it."""
        self._look_at(signed_in, now)
        signed_in.touched_at = now

    def unlock(self, signed_in: SignedIn, now: float) -> str:
        """The password was given again: the right to command is back; a new token."""
        signed_in.password_at = signed_in.touched_at = now
        self._rest(signed_in, False)
        return self.new_token(signed_in)

    def look(self, now: float) -> None:
        """Ends what has lasted long enough; to be called every second or so."""
        for each in self:
            self._look_at(each, now)

    def _look_at(self, signed_in: SignedIn, now: float) -> None:
        if signed_in.pages:
            signed_in.seen_at = now
        if now - signed_in.began_at > LASTS_S:
            self.end(signed_in, "expired")
        elif now - signed_in.seen_at > IDLE_S:
            self.end(signed_in, "idle")
        elif signed_in.account.may_command and not any(page.in_control for page in signed_in.pages):
            untouched = now - signed_in.touched_at > COMMANDS_UNTOUCHED_S
            long_ago = now - signed_in.password_at > COMMANDS_AFTER_PASSWORD_S
            if untouched or long_ago:
                self._rest(signed_in, True)

    def _rest(self, signed_in: SignedIn, resting: bool) -> None:
        if signed_in.resting is not resting:
            signed_in.resting = resting
            _tell(signed_in)

    def take_up(self, accounts: Accounts, *, changed_by: SignedIn | None = None) -> None:
        """The accounts have changed: who is no longer one is out, and roles hold at once.

        Args:
            changed_by: Whose own new password ends none of its own session.
        """
        self.accounts = dict(accounts)
        for each in self:
            before, now = each.account, self.accounts.get(each.account.name)
            # An account that was removed and made anew is another one.
            if now is None or now.created != before.created:
                self.end(each, "removed")
            elif now.disabled:
                self.end(each, "disabled")
            elif now.hash != before.hash and each is not changed_by:
                self.end(each, "password")
            else:
                each.account = now
                if now.role is not before.role:
                    _tell(each)


def _tell(signed_in: SignedIn) -> None:
    for page in tuple(signed_in.pages):
        page.rights_changed()
