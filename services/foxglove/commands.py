"""Commands as Foxglove services: stop for every client, the others in the name of one operator.

A client has control only while it is subscribed to a channel of the robot. A closed panel or a lost
connection stops its motion and releases control.
"""

import asyncio
import contextlib
import json
import logging
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any

import foxglove
from foxglove import MessageSchema, Schema, ServiceRequest, ServiceSchema

from robomesh import bounded_json
from robomesh import reason_codes as codes
from robomesh.client.robot.commands import CommandResult, Progress, request_stop
from robomesh.client.robot.control import AsyncArm
from robomesh.client.robot.robot import AsyncRobot
from robomesh.contract.keys import robot_key
from robomesh.contract.messages import JSON, decode_request
from robomesh.errors import MessageError, MotionError, RefusedError, RobomeshError
from robomesh.schemas.robomesh_pb2 import CommandRequest
from robomesh.wire.session import Session

log = logging.getLogger(__name__)

_RobotKey = tuple[str, str]
_Watches = Callable[[int, str, str], bool]

_MOTIONS: dict[str, Callable[[AsyncArm, CommandRequest], Awaitable[CommandResult]]] = {
    "home": lambda arm, request: arm.home(wait=False),
    "resume": lambda arm, request: arm.resume(wait=False),
    "move_absolute": lambda arm, request: arm.move_joints(request.joint_positions, wait=False),
    "move_relative": lambda arm, request: arm.move_joints_by(request.joint_positions, wait=False),
}
_COMMANDS = _MOTIONS | {
    "hold": lambda arm, request: arm.hold(),
    "reset": lambda arm, request: arm.reset(),
    "speed": lambda arm, request: arm.speed(request.speed_percent),
}
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
_POLL_S = 0.2


class Commands:
    """The services of every robot.

    Args:
        operator: Name of the operator that commands carry; if empty, only stop is offered.
        watches: Returns whether a client is subscribed to a channel of a robot.
    """

    def __init__(self, session: Session, operator: str, watches: _Watches) -> None:
        self._session, self._operator, self._watches = session, operator, watches
        self._loop = asyncio.get_running_loop()
        # Client and arm, while the client's motion runs.
        self._moving: dict[_RobotKey, tuple[int, AsyncArm]] = {}
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
        by = self._operator or "foxglove"
        stopped = await request_stop(self._session, site, robot, by, reason or "stop in Foxglove")
        return stopped.sent, stopped.text

    async def _command(
        self, site: str, robot: str, client: int, payload: bytes, *, name: str
    ) -> tuple[bool, str]:
        values = _values(name, payload) | {"command": name.upper()}
        request = decode_request(CommandRequest, json.dumps(values).encode(), JSON)
        moving = self._moving.get((site, robot))
        if moving is not None and moving[0] == client:
            return True, (await _COMMANDS[name](moving[1], request)).text
        if name in _MOTIONS and not self._watches(client, site, robot):
            return False, (
                f"this client is not subscribed to {site}/{robot}: open its joints before it moves"
            )
        arm = AsyncRobot(self._session, site, robot).control(self._operator)
        arm.progress = Progress(stop_reason="the Foxglove client in control has left")
        async with contextlib.AsyncExitStack() as control:
            await control.enter_async_context(arm)
            answer = await _COMMANDS[name](arm, request)
            if name in _MOTIONS:
                task = self._loop.create_task(self._keep_control(client, arm, control.pop_all()))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
        return True, answer.text

    async def _keep_control(self, client: int, arm: AsyncArm, control: contextlib.AsyncExitStack) -> None:
        """Keep control until the motion ends or the client leaves; then release it, and stop the robot."""
        moving = self._moving[arm.site, arm.robot] = client, arm
        try:
            async with control:
                await self._until_ended(client, arm)
        except MotionError as error:
            log.info("%s: %s", arm, error)
        except RobomeshError as error:
            log.warning("%s: %s", arm, error)
        finally:
            # Control may have been taken away, and acquired for another client since.
            if self._moving.get((arm.site, arm.robot)) is moving:
                del self._moving[arm.site, arm.robot]

    async def _until_ended(self, client: int, arm: AsyncArm) -> None:
        ended = asyncio.create_task(arm.wait())
        try:
            while self._watches(client, arm.site, arm.robot):
                done, _ = await asyncio.wait((ended,), timeout=_POLL_S)
                if done:
                    return await ended
            log.warning("%s: the client in control has left: the robot is stopped", arm)
        finally:
            ended.cancel()  # stops the robot
            await asyncio.gather(ended, return_exceptions=True)

    async def close(self) -> None:
        """Stop running motions, and release all control."""
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
        values = bounded_json.loads(payload or b"{}", parse_constant=_not_finite)
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
