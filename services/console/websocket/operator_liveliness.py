"""Whoever has control through a page is present on the mesh for as long as the page's connection lasts.

The gateway ends a lease whose session is gone: a browser that was killed loses control at once, and
not only when its lease's time is over. So does a player with a replay that a page has opened.
"""

import secrets
import time
from collections.abc import Iterator
from contextlib import contextmanager

import zenoh
from google.protobuf.message import DecodeError

from robomesh import keys
from robomesh import reason_codes as codes
from robomesh.errors import BusError, RefusedError
from robomesh.presence import OPERATOR, session_of
from robomesh.schemas.robomesh_pb2 import LeaseRequest
from robomesh.session import Session

_ACTION = LeaseRequest.Action
_GIVES_CONTROL = frozenset({_ACTION.ACQUIRE, _ACTION.ACCEPT, _ACTION.TAKE})
_KEEPS_CONTROL = _GIVES_CONTROL | {_ACTION.RENEW}
_HELD_S = 6.0  # no lease is given for longer
_REQUEST = "lease/request/"
_OPENS = "player/open"


class OperatorPresence:
    """The presence of one page's operator: a token for each robot under control, one for replays.

    Args:
        own_name: The one operator that the page asks as; empty: any, without certificates.

    Attributes:
        id: Of the page's connection; the page puts it into its lease requests as `session`.
    """

    def __init__(self, session: Session, own_name: str = "") -> None:
        self.id = session_of(own_name) if own_name else secrets.token_hex(8)
        self._session = session
        self._tokens: dict[tuple[str, str], zenoh.LivelinessToken] = {}
        self._held_at = -_HELD_S

    @property
    def in_control(self) -> bool:
        """Whether control of a robot was given or renewed just now."""
        return time.monotonic() - self._held_at < _HELD_S

    @contextmanager
    def asking(self, key: keys.Key, payload: bytes) -> Iterator[None]:
        """Around a request: present before control can be had, and no longer once it is not.

        Raises:
            RefusedError: If it is asked for a lease with something else.
        """
        site, robot, topic = key
        action: LeaseRequest.Action | None = None
        if topic.startswith(_REQUEST):
            try:
                action = LeaseRequest.FromString(payload).action
            except DecodeError:
                raise RefusedError(codes.INVALID(detail="this is no LeaseRequest")) from None
        new = (topic == _OPENS or action in _GIVES_CONTROL) and (site, robot) not in self._tokens
        if new:
            self._tokens[site, robot] = self._session.declare_presence_of(site, robot, OPERATOR, self.id)
        try:
            yield
        except BusError:
            # Refused, or not answered: if it was done all the same, nobody knows of it.
            if new:
                self._end(site, robot)
            raise
        if action == _ACTION.RELEASE:
            self._end(site, robot)
            self._held_at = -_HELD_S
        elif action in _KEEPS_CONTROL:
            self._held_at = time.monotonic()

    def close(self) -> None:
        """The page is gone, or may have control no longer."""
        self._held_at = -_HELD_S
        for site, robot in tuple(self._tokens):
            self._end(site, robot)

    def _end(self, site: str, robot: str) -> None:
        token = self._tokens.pop((site, robot), None)
        if token is not None:
            token.undeclare()
