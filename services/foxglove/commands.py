"""Commands as Foxglove services: stop for every client, the others in the name of one operator.

A client has control only while it is subscribed to a channel of the robot. A closed panel or a lost
connection releases control, and the robot's gateway stops the motion.
"""

import asyncio
import json
import logging
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import foxglove
from foxglove import MessageSchema, Schema, ServiceRequest, ServiceSchema

from robomesh import reason_codes as codes
from robomesh.errors import BusError, MessageError, RefusedError
from robomesh.keys import robot_key
from robomesh.lease import Control, control
from robomesh.messages import JSON, decode_request
from robomesh.schemas.robomesh_pb2 import (
    CommandAnswer,
    CommandRequest,
    ControllerState,
    Lease,
    StopAnswer,
    StopRequest,
)
from robomesh.session import Session

log = logging.getLogger(__name__)

_RobotKey = tuple[str, str]
_Watches = Callable[[int, str, str], bool]

_COMMANDS = ("home", "hold", "resume", "reset", "speed", "move_absolute", "move_relative")
_MOTIONS = (
    CommandRequest.HOME,
    CommandRequest.RESUME,
    CommandRequest.MOVE_ABSOLUTE,
    CommandRequest.MOVE_RELATIVE,
)
_NUMBERS = {"type": "array", "items": {"type": "number"}, "description": "rad, or m for a prismatic joint"}
# Fields of each request; any other field is refused.
_FIELDS: dict[str, dict[str, Any]] = {
    "stop": {"reason": {"type": "string"}},
    "speed": {"speed_percent": {"type": "number"}},
    "move_absolute": {"joint_positions": _NUMBERS},
    "move_relative": {"joint_positions": _NUMBERS},
}
_ANSWER = {
    "accepted": {"type": "boolean"},
    "text": {"type": "string"},
    "code": {"type": "string", "description": "of a refusal"},
    "values": {"type": "object", "description": "of a refusal: the parameters of its sentence"},
}
_LATEST_NS = 3_000_000_000
_ANSWER_S = 5.0
# `lease` is published each second; without it for this long, the gateway is offline.
_LEASE_TIMEOUT_S = 5.0
_POLL_S = 0.2


@dataclass
class _ControlSession:
    """Control that a client has while its motion runs."""

    client: int
    control: Control
    commands: int = 0
    since_ns: int = field(default_factory=time.monotonic_ns)

    def stamp(self, request: CommandRequest) -> None:
        """Set a command's lease, number and expiry; a late command must not move the arm."""
        self.commands += 1
        request.lease, request.id = self.control.lease, self.commands
        now_ns = self.control.now_ns + time.monotonic_ns() - self.since_ns
        request.not_after.FromNanoseconds(now_ns + _LATEST_NS)


class Commands:
    """The services of every robot.

    Args:
        operator: Name of the operator that commands carry; if empty, only stop is offered.
        watches: Returns whether a client is subscribed to a channel of a robot.
    """

    def __init__(self, session: Session, operator: str, watches: _Watches) -> None:
        self._session, self._operator, self._watches = session, operator, watches
        self._loop = asyncio.get_running_loop()
        self._holding: dict[_RobotKey, _ControlSession] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def of(self, site: str, robot: str) -> list[foxglove.Service]:
        """Return a robot's services, named `robomesh/<site>/<robot>/<command>`."""
        names = ("stop", *(_COMMANDS if self._operator else ()))
        return [self._service(site, robot, name) for name in names]

    def _service(self, site: str, robot: str, name: str) -> foxglove.Service:
        work = self._stop if name == "stop" else partial(self._command, name=name)

        def handle(request: ServiceRequest) -> bytes:
            """Handle a request on a thread of the SDK."""
            answering = asyncio.run_coroutine_threadsafe(
                _json_answer(work(site, robot, request.client_id, request.payload)), self._loop
            )
            return answering.result()

        schemas = ServiceSchema(
            f"robomesh.{name}", request=_json(name, _FIELDS.get(name, {})), response=_json("answer", _ANSWER)
        )
        return foxglove.Service(robot_key(site, robot, name), schema=schemas, handler=handle)

    async def _stop(self, site: str, robot: str, client: int, payload: bytes) -> tuple[bool, str]:
        try:
            reason = str(_values("stop", payload).get("reason", ""))
        except RefusedError:
            reason = ""  # an invalid reason must not prevent the stop
        request = StopRequest(by=self._operator or "foxglove", reason=reason or "stop in Foxglove")
        answer = await self._session.ask(robot_key(site, robot, "stop"), request)
        assert isinstance(answer, StopAnswer)
        return answer.sent, answer.text

    async def _command(
        self, site: str, robot: str, client: int, payload: bytes, *, name: str
    ) -> tuple[bool, str]:
        values = _values(name, payload) | {"command": name.upper()}
        request = decode_request(CommandRequest, json.dumps(values).encode(), JSON)
        if request.command == CommandRequest.RESET:
            request.stop_id = await self._latched_stop(site, robot)
        holding = self._holding.get((site, robot))
        if holding is not None and holding.client == client:
            return await self._send(site, robot, holding, request)
        if request.command in _MOTIONS and not self._watches(client, site, robot):
            return False, (
                f"this client is not subscribed to {site}/{robot}: open its joints before it moves"
            )
        answered: asyncio.Future[tuple[bool, str]] = self._loop.create_future()
        task = self._loop.create_task(self._run_in_control(site, robot, client, request, answered))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return await answered

    async def _run_in_control(
        self,
        site: str,
        robot: str,
        client: int,
        request: CommandRequest,
        answered: "asyncio.Future[tuple[bool, str]]",
    ) -> None:
        """Take control, send the command, and keep control until the motion ends or the client leaves."""
        holding: _ControlSession | None = None
        try:
            async with control(self._session, site, robot, self._operator) as acquired:
                holding = _ControlSession(client, acquired)
                answer = await self._send(site, robot, holding, request)
                moves = answer[0] and request.command in _MOTIONS
                if moves:
                    self._holding[site, robot] = holding
                answered.set_result(answer)
                if moves:
                    await self._wait_for_motion(site, robot, holding)
        except BusError as error:
            if answered.done():
                log.warning("%s/%s: %s", site, robot, error)
            else:
                answered.set_exception(error)
        finally:
            # Another client's session stays if this client's was refused.
            if holding is not None and self._holding.get((site, robot)) is holding:
                del self._holding[site, robot]
            if not answered.done():
                answered.cancel()

    async def _send(
        self, site: str, robot: str, holding: _ControlSession, request: CommandRequest
    ) -> tuple[bool, str]:
        holding.stamp(request)
        key = robot_key(site, robot, f"command/{self._operator}")
        answer = await self._session.ask(key, request, timeout_s=_ANSWER_S)
        assert isinstance(answer, CommandAnswer)
        return answer.accepted, answer.text

    async def _wait_for_motion(self, site: str, robot: str, holding: _ControlSession) -> None:
        over = asyncio.create_task(self._motion_ended(site, robot))
        try:
            while not over.done() and not holding.control.renewing.done():
                await asyncio.wait((over, holding.control.renewing), timeout=_POLL_S)
                if not self._watches(holding.client, site, robot):
                    log.warning("%s/%s: the client in control has left: control is released", site, robot)
                    return
        finally:
            over.cancel()

    async def _motion_ended(self, site: str, robot: str) -> None:
        """Return when the gateway reports that the holder's motion has ended, or stops reporting."""
        leases = self._session.subscribe(robot_key(site, robot, "lease"), newest=20)
        try:
            while True:
                async with asyncio.timeout(_LEASE_TIMEOUT_S):
                    sample = await anext(leases)
                lease = sample.message()
                assert isinstance(lease, Lease)
                if sample.live and not (lease.motion and lease.holder == self._operator):
                    return
        except (TimeoutError, BusError) as error:
            log.warning("%s/%s: the gateway is silent: %s", site, robot, error or "no lease is published")
        finally:
            leases.close()

    async def _latched_stop(self, site: str, robot: str) -> int:
        state = await self._session.last(robot_key(site, robot, "controller"))
        return state.stop.id if isinstance(state, ControllerState) else 0

    async def close(self) -> None:
        """Release all control; the gateways stop running motions."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)


async def _json_answer(work: Awaitable[tuple[bool, str]]) -> bytes:
    answer: dict[str, object] = {}
    try:
        answer["accepted"], answer["text"] = await work
    except RefusedError as error:
        values = dict(error.reason.values)
        answer = {"accepted": False, "text": str(error), "code": error.reason.code, "values": values}
    except MessageError as error:
        answer = {"accepted": False, "text": str(error)}
    return json.dumps(answer).encode()


def _values(name: str, payload: bytes) -> dict[str, Any]:
    """Parse a request's fields.

    Raises:
        RefusedError: If it is not a JSON object, or has a field that this command does not have.
    """
    try:
        values = json.loads(payload or b"{}", parse_constant=_not_finite)
    except (ValueError, RecursionError) as error:
        raise RefusedError(codes.NOT_JSON(detail=error)) from None
    if not isinstance(values, dict):
        raise RefusedError(codes.NOT_JSON_OBJECT())
    known = _FIELDS.get(name, {})
    for key in values:
        if key not in known:
            fields = ", ".join(known) or "nothing: {}"
            raise RefusedError(codes.UNKNOWN_FIELD(request=name, field=key, fields=fields))
    return values


def _not_finite(word: str) -> None:
    raise RefusedError(codes.NOT_FINITE(value=word))


def _json(name: str, fields: dict[str, Any]) -> MessageSchema:
    described = {"type": "object", "properties": fields}
    data = json.dumps(described).encode()
    return MessageSchema(
        encoding="json", schema=Schema(name=f"robomesh.{name}", encoding="jsonschema", data=data)
    )
