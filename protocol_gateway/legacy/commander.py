"""Old client program that may command: its lease, and its units in order.

unit received    its stop is executed, its lease renewed --> queue --> lease --> control.commands
waits > 1 s, or 32 units are queued  refused
2 s without a unit                   the lease expires
its connection ends                  the lease ends, queued units are dropped
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress

from protocol_gateway.authority.admission import LONGEST_WAIT_S
from protocol_gateway.authority.events import LeaseEnded
from protocol_gateway.authority.lease_rules import holds
from protocol_gateway.execution.clocks import read_clocks
from protocol_gateway.execution.control import Control
from protocol_gateway.legacy.requests import FAULT, READ_ONLY, number_of, requests_of, stop_to_reset
from protocol_gateway.unit_protocol.records import Error
from protocol_gateway.unit_protocol.stream import Unit
from robomesh.errors import RefusedError
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import CommandRequest, LeaseRequest
from robots.kinematics.joints import Joints

_A = LeaseRequest.Action
_RESET = CommandRequest.Command.RESET
# Shortest interval of renewals; the lifetime includes it, so that a lease ends after 2 s of silence.
_RENEW_S = 0.1
_TTL_S = 2.0 + _RENEW_S
_MOST_WAITING = 32


class Commander:
    """Connection of a program that commands in an operator's name.

    Args:
        refuse: Answers a unit with an Error; `written`: Control has already audited the refusal.
    """

    def __init__(
        self,
        control: Control,
        joints: Joints,
        *,
        operator: str,
        source: str,
        refuse: Callable[[Unit, Error, bool], None],
    ) -> None:
        self.operator = operator
        self._control = control
        self._joints = joints
        self._source = source
        self._refuse = refuse
        self._secret = ""
        self._last_id = 0
        self._renewed_s = float("-inf")
        self._waiting: deque[tuple[Unit, float]] = deque()
        self._work: asyncio.Task[None] | None = None
        self._renewal: asyncio.Task[None] | None = None
        self._end_reason: Reason | None = None

    @property
    def holds_lease(self) -> bool:
        """True if the program holds the lease."""
        return holds(self._control.authority, self.operator, self._secret)

    def renew(self) -> None:
        """Renew the program's lease, if it has one, because a unit was received."""
        now_s = time.monotonic()
        if self.holds_lease and now_s - self._renewed_s >= _RENEW_S:
            self._renewed_s = now_s
            self._renewal = asyncio.create_task(self._renew())

    def submit(self, unit: Unit) -> None:
        """Queue a unit for execution."""
        if len(self._waiting) >= _MOST_WAITING:
            self._refuse(unit, Error(FAULT, f"{_MOST_WAITING} of your units are queued: send fewer"), False)
            return
        self._waiting.append((unit, time.monotonic()))
        if self._work is None or self._work.done():
            self._work = asyncio.create_task(self._do_all())

    def end(self, why: Reason) -> None:
        """End the lease and drop queued units, because the connection has ended."""
        self._end_reason = why
        self._waiting.clear()
        if self.holds_lease:
            self._control.handle(LeaseEnded(why))

    async def settle(self) -> None:
        """Wait until the current unit is executed or refused."""
        for task in (self._work, self._renewal):
            if task is not None:
                await asyncio.wait([task])

    async def _renew(self) -> None:
        with suppress(RefusedError):  # the lease has just ended
            await self._lease(_A.RENEW)

    async def _do_all(self) -> None:
        while self._waiting:
            unit, received_s = self._waiting.popleft()
            requests = self._requests(unit, received_s)
            if isinstance(requests, Error):
                self._refuse(unit, requests, False)
            elif requests:
                await self._do(unit, requests)

    def _requests(self, unit: Unit, received_s: float) -> Sequence[CommandRequest] | Error:
        requests = requests_of(unit.records, self._joints)
        if isinstance(requests, Error):
            return requests
        now = read_clocks()
        left_s = LONGEST_WAIT_S - (now.monotonic_s - received_s)
        for request in requests:
            if request.command == _RESET:
                stop = stop_to_reset(self._control.authority, received_s)
                if isinstance(stop, Error):
                    return stop
                request.stop_id = stop
            request.not_after.FromNanoseconds(now.gateway_ns + int(left_s * 1e9))
        return requests

    async def _do(self, unit: Unit, requests: Sequence[CommandRequest]) -> None:
        try:
            if not self.holds_lease:
                await self._lease(_A.ACQUIRE)
        except RefusedError as error:
            self._refuse(unit, Error(READ_ONLY, str(error)), True)
            return
        if self._end_reason is not None:
            self.end(self._end_reason)
            return
        for request in requests:
            self._last_id += 1
            request.lease, request.id = self._secret, self._last_id
        answer = await self._control.attempt(requests, operator=self.operator, source=self._source)
        if not answer.accepted:
            self._refuse(unit, Error(number_of(answer), answer.text), True)

    async def _lease(self, action: LeaseRequest.Action) -> None:
        request = LeaseRequest(action=action, lease=self._secret, ttl_s=_TTL_S)
        answer = await self._control.lease(request, operator=self.operator, source=self._source)
        self._secret = answer.lease
        self._renewed_s = time.monotonic()
