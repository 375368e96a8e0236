"""Presence of operators: a liveliness token for as long as a page's connection lasts.

The gateway ends a lease without its session: if a browser is killed, it loses control immediately, not
when its lease expires. A player ends a replay that a page has opened in the same way.
"""

import asyncio
import secrets
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import zenoh
from google.protobuf.message import DecodeError

from robomesh import reason_codes as codes
from robomesh.contract import keys
from robomesh.errors import RefusedError, RobomeshError
from robomesh.schemas.robomesh_pb2 import LeaseAnswer, LeaseRequest
from robomesh.wire.presence import OPERATOR, session_of
from robomesh.wire.session import Session

_ACTION = LeaseRequest.Action
_GIVES_CONTROL = frozenset({_ACTION.ACQUIRE, _ACTION.ACCEPT, _ACTION.TAKE})
_KEEPS_CONTROL = _GIVES_CONTROL | {_ACTION.RENEW}
_HELD_S = 6.0  # the longest lease
_RELEASED_WITHIN_S = 0.5
_REQUEST = "lease/request/"
_OPENS = "player/open"


class OperatorPresence:
    """The presence of one page's operator: a token for each robot under control, and for replays.

    Args:
        own_name: The operator that the page acts as; empty if it may use any name, without certificates.

    Attributes:
        id: Identity of the page's connection; the page sends it as `session` in its lease requests.
    """

    def __init__(self, session: Session, own_name: str = "") -> None:
        self.id = session_of(own_name) if own_name else secrets.token_hex(8)
        self._session = session
        self._tokens: dict[tuple[str, str], zenoh.LivelinessToken] = {}
        # Keys and secrets of the page's leases, to release them with their cause.
        self._leases: dict[keys.Key, str] = {}
        self._releases: set[asyncio.Task[None]] = set()
        self._held_at = -_HELD_S

    @property
    def in_control(self) -> bool:
        """True if control of a robot was granted or renewed within the longest lease."""
        return time.monotonic() - self._held_at < _HELD_S

    @contextmanager
    def during_request(self, key: keys.Key, payload: bytes) -> Iterator[Callable[[bytes], None]]:
        """Keep the operator present during a request, and after it while it has control.

        Raises:
            RefusedError: If the payload of a lease request is invalid.
        """
        site, robot, topic = key
        action: LeaseRequest.Action | None = None
        if topic.startswith(_REQUEST):
            try:
                action = LeaseRequest.FromString(payload).action
            except DecodeError:
                raise RefusedError(codes.INVALID(codes.NOT_LEASE_REQUEST())) from None
        new = (topic == _OPENS or action in _GIVES_CONTROL) and (site, robot) not in self._tokens
        if new:
            self._tokens[site, robot] = self._session.declare_presence_of(site, robot, OPERATOR, self.id)

        def answered(answer: bytes) -> None:
            """Note the lease that an answer grants."""
            if action in _GIVES_CONTROL:
                self._leases[key] = LeaseAnswer.FromString(answer).lease

        try:
            yield answered
        except RobomeshError:
            # Refused or not answered; if it was granted without an answer, no client will use it.
            if new:
                self._end(site, robot)
            raise
        if action == _ACTION.RELEASE:
            self._leases.pop(key, None)
            self._end(site, robot)
            self._held_at = -_HELD_S
        elif action in _KEEPS_CONTROL:
            self._held_at = time.monotonic()

    def close(self, cause: LeaseRequest.Cause | None = None) -> None:
        """Withdraw all presence: the page is gone, or may no longer have control.

        Args:
            cause: Cause for every page to show; without one, control ends with the presence.
        """
        held = {} if cause is None or not self.in_control else self._leases
        self._held_at, self._leases = -_HELD_S, {}
        for key, lease in held.items():
            release = LeaseRequest(action=_ACTION.RELEASE, lease=lease, cause=cause)
            task = asyncio.create_task(self._release(key, release))
            self._releases.add(task)
            task.add_done_callback(self._releases.discard)
        for site, robot in tuple(self._tokens):
            if not any((key.site, key.robot) == (site, robot) for key in held):
                self._end(site, robot)

    async def _release(self, key: keys.Key, request: LeaseRequest) -> None:
        """Release a lease with its cause; without an answer it ends with its operator's presence."""
        try:
            with suppress(RobomeshError):
                await self._session.ask(str(key), request, timeout_s=_RELEASED_WITHIN_S)
        finally:
            self._end(key.site, key.robot)

    def _end(self, site: str, robot: str) -> None:
        token = self._tokens.pop((site, robot), None)
        if token is not None:
            token.undeclare()
