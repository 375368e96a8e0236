"""The view tokens of a running console: who may read, and the end of what a revoked token reads.

A token that the file knows never waits: nobody guesses 256 random bits, and a screen with a wrong token must
not shut out the others of its address. Unknown tokens wait as failed sign-ins of an address do.
"""

import asyncio
import math
import time
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from robomesh import reason_codes as codes
from robomesh.publications.wall_clock import ForwardClock
from robomesh.schemas.robomesh_pb2 import Event
from services.console.accounts.file import changing, now, read_accounts
from services.console.accounts.refusal_events import PublishEvent, RefusalEvents
from services.console.accounts.sign_in_attempts import Attempts, network
from services.console.accounts.view_token import (
    MOST_TOKENS,
    ViewToken,
    check_token_scope,
    find_token,
    new_token,
)
from services.console.common.errors import AccountsError, SignInError

# A token's use is an event once for each address; so many pairs are remembered.
_MOST_READERS = 1024


@dataclass(eq=False)
class TokenRequest:
    """A request that a token opened.

    Attributes:
        ended: The token ended, and the request with it.
    """

    token: ViewToken
    _running: set["TokenRequest"]
    ended: bool = False
    _task: asyncio.Task[Any] | None = None

    @contextmanager
    def serving(self) -> Iterator[None]:
        """Register the running task, which is cancelled when the token ends."""
        self._task = asyncio.current_task()
        self._running.add(self)
        try:
            yield
        finally:
            self._running.discard(self)

    def end(self) -> None:
        """End the request."""
        if not self.ended and self._task is not None:
            self.ended = True
            self._task.cancel()


class ViewTokens:
    """The tokens of the accounts file, and the requests that they opened.

    Args:
        publish_event: Publishes an event: severity, code, text, values.
    """

    def __init__(self, tokens: Mapping[str, ViewToken], publish_event: PublishEvent) -> None:
        self._tokens = dict(tokens)
        self._publish_event = publish_event
        self._running: set[TokenRequest] = set()
        self._attempts = Attempts(free=10, longest_s=900.0)
        self._readers: OrderedDict[tuple[str, str], None] = OrderedDict()
        self._refusals = RefusalEvents(publish_event, "token.refused")
        # A clock that is set back must not make an expired token valid again.
        self._clock = ForwardClock()

    def _now(self) -> datetime:
        return datetime.fromtimestamp(self._clock.now_s(), UTC)

    def check(self, token: str, robot: str, view: str, *, address: str) -> TokenRequest:
        """Check the token of a request for a view of a robot (`<site>/<robot>`).

        Raises:
            SignInError: If it is unknown, has ended or is for something else, or the address has to wait.
        """
        found, at = find_token(self._tokens, token), time.monotonic()
        if found is None:
            wait_s = self._attempts.wait_s(network(address), at)
            if wait_s <= 0:
                self._attempts.begin(network(address), at)
            self._refusals.publish(f"an unknown token from {address} was refused", {"address": address})
            if wait_s > 0:
                raise SignInError(codes.ACCOUNT_WAIT(seconds=math.ceil(wait_s)), wait_s)
            raise SignInError(codes.TOKEN_UNKNOWN())
        if (ended := found.ended(self._now())) is not None:
            raise SignInError(ended)
        if (found.robot, found.view) != (robot, view):
            raise SignInError(codes.TOKEN_OTHER_VIEW(token=found.name, robot=found.robot, view=found.view))
        self._publish_reader(found, address)
        return TokenRequest(found, self._running)

    def apply(self, tokens: Mapping[str, ViewToken]) -> None:
        """Apply a changed file: end what changed or removed tokens read."""
        before, self._tokens = self._tokens, dict(tokens)
        for name in before.keys() | tokens.keys():
            self._publish_change(before.get(name), tokens.get(name))
        self.expire()

    def expire(self) -> None:
        """End the requests whose token is no longer valid; call it about once a second."""
        at = self._now()
        for request in tuple(self._running):
            if self._tokens.get(request.token.name) != request.token or request.token.ended(at):
                request.end()

    # ------------------------------------------------------------------------- events

    def _publish_change(self, before: ViewToken | None, after: ViewToken | None) -> None:
        was = before if before is not None and before.revoked is None else None
        valid = after if after is not None and after.revoked is None else None
        if was is not None and was != valid:
            self._publish(was, "token.revoked", f"token {was.name} is revoked")
        if valid is not None and was != valid:
            text = f"token {valid.name} opens the view {valid.view} of {valid.robot}"
            self._publish(valid, "token.added", text)

    def _publish_reader(self, token: ViewToken, address: str) -> None:
        reader = (token.hash, network(address))
        known = reader in self._readers
        self._readers[reader] = None
        self._readers.move_to_end(reader)
        if len(self._readers) > _MOST_READERS:
            self._readers.popitem(last=False)
        if not known:
            text = f"token {token.name} is used from {address}"
            self._publish(token, "token.used", text, address=address)

    def _publish(self, token: ViewToken, code: str, text: str, **values: str) -> None:
        given = {"token": token.name, "robot": token.robot, "view": token.view, **values}
        self._publish_event(Event.INFO, code, text, given)


def add_token(path: Path, name: str, robot: str, view: str, *, lasts: timedelta | None) -> str:
    """Add a token to an accounts file and return it; a revoked token's name can be used again.

    Args:
        lasts: None: it is valid until it is revoked.

    Raises:
        AccountsError: If something is invalid, the name is in use, or the file cannot be written.
    """
    check_token_scope(name, robot, view)
    read_accounts(path)  # a file without accounts would be refused by the console
    token, hashed = new_token()
    created = now()
    with changing(path) as found:
        before = found.tokens.pop(name, None)
        if before is not None and before.revoked is None:
            raise AccountsError(
                f"{path}: there is a token {name} already: revoke it first, or use another name"
            )
        if len(found.tokens) >= MOST_TOKENS:
            raise AccountsError(f"{path}: {MOST_TOKENS} tokens: remove entries of revoked ones from the file")
        found.tokens[name] = ViewToken(
            name=name,
            robot=robot,
            view=view,
            hash=hashed,
            created=created,
            expires=None if lasts is None else created + lasts,
        )
    return token


def revoke_token(path: Path, name: str) -> None:
    """Revoke a token of an accounts file.

    Raises:
        AccountsError: If there is no valid token of this name, or the file cannot be written.
    """
    with changing(path) as found:
        token = found.tokens.get(name)
        if token is None or token.revoked is not None:
            valid = ", ".join(each.name for each in found.tokens.values() if each.revoked is None)
            raise AccountsError(f"{path}: no token {name!r}; tokens: {valid or 'none'}")
        found.tokens[name] = replace(token, revoked=now())
