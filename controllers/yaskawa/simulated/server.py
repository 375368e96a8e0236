"""Server of one simulated controller: answers each question immediately, except for the faults."""

import asyncio
import time
from collections.abc import Callable
from typing import Any, cast

from controllers.simulated import faults as effects
from controllers.simulated.faults import Faults
from controllers.yaskawa import commands
from controllers.yaskawa.hses import Command, Service
from controllers.yaskawa.simulated import messages
from controllers.yaskawa.simulated.controller import NO_ALARM, HsesController, Refusal
from controllers.yaskawa.simulated.messages import Question

HSES_FAULTS = (
    *("freeze", "garbage", "flood", "deluge", "jump", "corrupt", "local", "fault", "mute", "joints"),
    *("restart", "refuse", "burst", "busy", "loss"),
)
"""Faults that this controller can show; the others concern connections or commands."""

_TICK_S = 0.01
_HOLD_BACK_S = 2.0
_SINGLE_FAILURE, _BUSY = 0x1F, 0xD8F1
_NO_COMMAND, _NO_ATTRIBUTE, _NO_INSTANCE = 0x08, 0x09, 0x28
_ALARM = (4107, 1, "OUT OF RANGE (ABSO DATA)")
# Added to the number of a robot: its pose.
_CARTESIAN = 100
# Each breaks another rule.
_GARBAGE = (
    b"",
    b"YERC",
    bytes(40),
    b"YERC\x20\x00\xff\x01" + bytes(24),
    b"\xff" * 600,
)


class HsesServer(asyncio.DatagramProtocol):
    """Server of one controller.

    Args:
        boot: Creates the controller for the time now, after a restart without servos.
        instance: Number of the control group that it has.
        sub_codes: Alarms have the texts of their sub-codes.
    """

    def __init__(
        self,
        boot: Callable[[bool], HsesController],
        fault_schedule: Faults,
        *,
        instance: int = 1,
        sub_codes: bool = True,
    ) -> None:
        self._boot = boot
        self._faults = fault_schedule
        self._instance = instance
        self._sub_codes = sub_codes
        self._transport: asyncio.DatagramTransport | None = None
        self.controller = boot(False)
        self.active: frozenset[str] = frozenset()
        self.questions = 0
        self._held_back: list[tuple[bytes, tuple[Any, ...]]] = []
        self._released_s = 0.0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the socket (called by asyncio)."""
        self._transport = cast("asyncio.DatagramTransport", transport)

    @property
    def listens(self) -> bool:
        """True unless a fault closes the port."""
        return not self.active & {"refuse"}

    async def run(self) -> None:
        """Move the arm until cancelled."""
        while True:
            now_s = time.monotonic()
            self.controller.tick(now_s)
            self.apply_faults(now_s)
            await asyncio.sleep(_TICK_S)

    def apply_faults(self, now_s: float) -> None:
        """Update the active faults, and apply their effects on the controller."""
        self.active, begun, ended = self._faults.changes(self.active, now_s)
        if "fault" in begun:
            self.controller.raise_alarm(*_ALARM, now_s)
        if "restart" in begun:
            self.controller = self._boot(True)
        if "fault" in ended:
            self.controller.reset(now_s)
        if self._held_back and ("burst" not in self.active or now_s - self._released_s >= _HOLD_BACK_S):
            # The newest first: datagrams may overtake each other.
            held_back, self._held_back = self._held_back[::-1], []
            for data, client in held_back:
                self._send(data, client)

    def datagram_received(self, data: bytes, client: tuple[Any, ...]) -> None:
        """Answer a question (called by asyncio)."""
        now_s = time.monotonic()
        self._faults.first_client(now_s)
        self.apply_faults(now_s)
        self.questions += 1
        lost = "loss" in self.active and not self.questions % 3
        if lost or self.active & {"freeze", "restart", "refuse"}:
            return
        question = messages.decode(data)
        if question is None or ("mute" in self.active and question.command == Command.STATUS):
            return
        if "garbage" in self.active:
            self._send(_GARBAGE[self.questions % len(_GARBAGE)], client)
        if "busy" in self.active and self.questions % 2:
            answer = messages.answer(question, status=_SINGLE_FAILURE, added_status=_BUSY)
        else:
            answer = self.answer(question, now_s)
        if "burst" in self.active:
            self._released_s = self._released_s if self._held_back else now_s
            self._held_back.append((answer, client))
            return
        for _ in range(effects.copies(self.active)):
            self._send(answer, client)

    def _send(self, data: bytes, client: tuple[Any, ...]) -> None:
        if self._transport is not None and not self._transport.is_closing():
            self._transport.sendto(data, client)

    # -------------------------------------------------------------------------- answers

    def answer(self, question: Question, now_s: float) -> bytes:
        """Return the answer to a question, or to a command, which is executed."""
        if question.command in (commands.POWER, commands.MOVE_PULSES):
            return self._execute(question, now_s)
        found = self._fields(question, now_s)
        if isinstance(found, int):
            return messages.answer(question, status=found)
        match question.service, question.attribute:
            case Service.ALL, 0:
                return messages.answer(question, b"".join(found))
            case Service.SINGLE, attribute if 1 <= attribute <= len(found):
                return messages.answer(question, found[attribute - 1])
            case Service.ALL | Service.SINGLE, _:
                return messages.answer(question, status=_NO_ATTRIBUTE)
        return messages.answer(question, status=_NO_COMMAND)

    def _execute(self, question: Question, now_s: float) -> bytes:
        """Execute a command that writes; return its answer."""
        single = question.command == commands.POWER
        if question.service != (commands.WRITE_SINGLE if single else commands.WRITE_ALL):
            return messages.answer(question, status=_NO_COMMAND)
        if question.attribute != 1:
            return messages.answer(question, status=_NO_ATTRIBUTE)
        known = (*commands.Switch,) if single else (commands.JOINT_ABSOLUTE,)
        if question.instance not in known:
            return messages.answer(question, status=_NO_INSTANCE)
        refusal = self._switch(question, now_s) if single else self._move(question, now_s)
        if refusal is None:
            return messages.answer(question)
        return messages.answer(question, status=_SINGLE_FAILURE, added_status=refusal)

    def _switch(self, question: Question, now_s: float) -> Refusal | None:
        if len(question.data) != 4:
            return Refusal.LENGTH
        value = int.from_bytes(question.data, "little")
        if value not in (commands.ON, commands.OFF):
            return Refusal.VALUE
        match question.instance:
            case commands.Switch.HOLD:
                return self.controller.hold(value == commands.ON, now_s, self.active)
            case commands.Switch.SERVO:
                return self.controller.servo(value == commands.ON, now_s, self.active)
        return None

    def _move(self, question: Question, now_s: float) -> Refusal | None:
        if len(question.data) != commands.MOTION.size:
            return Refusal.LENGTH
        robot, station, kind, speed, *rest = commands.MOTION.unpack(question.data)
        # A base is moved by the same command as its robot; this controller has none.
        others = rest[-commands.STATION_AXES - commands.BASE_AXES :]
        if (robot, station) != (self._instance, 0) or any(others):
            return Refusal.GROUP
        if kind != commands.PERCENT:
            return Refusal.SPEED
        return self.controller.move(rest[:8], speed / 100, now_s, self.active)

    def _fields(self, question: Question, now_s: float) -> list[bytes] | int:
        """Return the attributes of what was asked for, or the status of an error."""
        arm, instance = self.controller, question.instance
        of_group = instance == self._instance
        match question.command:
            case Command.POSITION if of_group:
                return messages.fields_of(arm.position(now_s, self.active))
            case Command.POSITION if instance == self._instance + _CARTESIAN <= _CARTESIAN + 8:
                return messages.fields_of(arm.pose(now_s))
            case Command.AXES if of_group:
                return messages.names(arm.axis_names(self.active))
            case Command.TORQUE if of_group:
                return messages.words(arm.torques(now_s))
            case Command.STATUS if instance == 1:
                return messages.fields_of(arm.status(now_s, self.active))
            case Command.ALARM if 1 <= instance <= 4:
                return messages.fields_of(arm.alarm(instance), sub_codes=self._sub_codes)
            case messages.ALARM_HISTORY if 1 <= instance % 1000 <= 100:
                past = arm.history[instance - 1 : instance] if instance <= 100 else []
                return messages.fields_of((past or [NO_ALARM])[0], sub_codes=self._sub_codes)
            case Command.JOB if 1 <= instance <= 16:
                return messages.fields_of(arm.job())
            case Command.SYSTEM if 11 <= instance <= 108:
                return messages.fields_of(arm.system())
            case Command.IO if 1 <= instance <= 9999:
                return [bytes([arm.io_byte(instance)])]
        return _NO_INSTANCE if question.command in (*Command, messages.ALARM_HISTORY) else _NO_COMMAND
