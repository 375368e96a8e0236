"""Sessions of signed-in users, by their tokens, and the reasons that end them.

A session is for watching, since control rooms watch for days: it lasts while one of its pages is open, at
most a week. The right to command is shorter: it is suspended half an hour after the last activity, and
twelve hours after the last password, until the password is entered again. An operator who has control at
that time keeps it: no motion stops because its operator only watched.

Sessions are in memory only: after a restart of the console all users sign in again. The caller passes the
time.
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
IDLE_S = 3600.0  # without an open page or a request
COMMANDS_UNTOUCHED_S = 1800.0
COMMANDS_AFTER_PASSWORD_S = 12 * 3600.0
MOST_OF_ACCOUNT = 16
MOST_PAGES = 32


class Page(Protocol):
    """A page's connection, as a session needs it."""

    @property
    def in_control(self) -> bool:
        """True if the page got control and has not released it."""

    def rights_changed(self) -> None:
        """Notify the page that its rights have changed."""


@dataclass(eq=False, kw_only=True)
class SignedIn:
    """A session of an account.

    Attributes:
        account: The current entry of the accounts file.
        id: Shown in lists and events; not secret, and no use for signing in.
        resting: The right to command is suspended until the password is entered again.
        ended: Reason of its end, a word for the page; empty while it lasts.
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
    # Hash of the session's token.
    key: bytes = b""

    @property
    def may_command(self) -> bool:
        """True if it may request control now."""
        return not self.ended and self.account.may_command and not self.resting

    @contextmanager
    def serving(self) -> Iterator[None]:
        """Register the running task, which is cancelled when the session ends."""
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        try:
            yield
        finally:
            self._tasks.discard(task)

    @contextmanager
    def with_page(self, page: Page) -> Iterator[None]:
        """Register a page's connection."""
        self.pages.add(page)
        try:
            yield
        finally:
            self.pages.discard(page)

    def end(self, why: str) -> None:
        """End the session and cancel its tasks."""
        self.ended = why
        for task in tuple(self._tasks):
            task.cancel()


def key_of(token: str) -> bytes:
    """Return a token's key; the tokens themselves are not stored."""
    return hashlib.sha256(token.encode(errors="replace")).digest()


class Sessions:
    """All sessions of a console.

    Args:
        on_end: Called with each session that ends.
    """

    def __init__(self, accounts: Accounts, *, on_end: Callable[[SignedIn], None] = lambda _: None) -> None:
        self.accounts = dict(accounts)
        self._on_end = on_end
        self._sessions: dict[bytes, SignedIn] = {}

    def __iter__(self) -> Iterator[SignedIn]:
        return iter(tuple(self._sessions.values()))

    def find(self, token: str, now: float) -> SignedIn | None:
        """Return the session of a token, or None."""
        found = self._sessions.get(key_of(token)) if token else None
        if found is not None:
            self._expire(found, now)
            found.seen_at = now
        return None if found is None or found.ended else found

    def open(
        self, account: Account, *, address: str, agent: str, now: float, at: datetime
    ) -> tuple[str, SignedIn]:
        """Open a session and return its token. Ends the account's least recently used one above the limit."""
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
        """Replace a session's token."""
        token = secrets.token_urlsafe(32)
        self._sessions.pop(signed_in.key, None)
        signed_in.key = key_of(token)
        self._sessions[signed_in.key] = signed_in
        return token

    def end(self, signed_in: SignedIn, why: str) -> None:
        """End a session, with its pages and downloads."""
        if self._sessions.pop(signed_in.key, None) is not None:
            signed_in.end(why)
            self._on_end(signed_in)

    def end_all(self, name: str, why: str, *, but: SignedIn | None = None) -> None:
        """End every session of an account."""
        for each in self:
            if each.account.name == name and each is not but:
                self.end(each, why)

    def touched(self, signed_in: SignedIn, now: float) -> None:
        """Record activity of a person on one of the session's pages."""
        self._expire(signed_in, now)
        signed_in.touched_at = now

    def unlock(self, signed_in: SignedIn, now: float) -> str:
        """Restore the right to command after the password was entered again; return a new token."""
        signed_in.password_at = signed_in.touched_at = now
        self._suspend(signed_in, False)
        return self.new_token(signed_in)

    def expire(self, now: float) -> None:
        """End sessions that have expired; call it about once a second."""
        for each in self:
            self._expire(each, now)

    def _expire(self, signed_in: SignedIn, now: float) -> None:
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
                self._suspend(signed_in, True)

    def _suspend(self, signed_in: SignedIn, resting: bool) -> None:
        if signed_in.resting is not resting:
            signed_in.resting = resting
            _notify_pages(signed_in)

    def apply_accounts(self, accounts: Accounts, *, changed_by: SignedIn | None = None) -> None:
        """Apply changed accounts: end sessions without a valid account, and apply new roles immediately.

        Args:
            changed_by: Session that set its own new password; it does not end.
        """
        self.accounts = dict(accounts)
        for each in self:
            before, now = each.account, self.accounts.get(each.account.name)
            # An account that was removed and added again is another account.
            if now is None or now.created != before.created:
                self.end(each, "removed")
            elif now.disabled:
                self.end(each, "disabled")
            elif now.hash != before.hash and each is not changed_by:
                self.end(each, "password")
            else:
                each.account = now
                if now.role is not before.role:
                    _notify_pages(each)


def _notify_pages(signed_in: SignedIn) -> None:
    for page in tuple(signed_in.pages):
        page.rights_changed()
