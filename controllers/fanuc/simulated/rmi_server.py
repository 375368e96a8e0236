"""RMI of the simulated controller: one client moves the arm by joint motions.

Where the manual (B-84184EN/03) is silent: RMI_MOVE continues after its client has disconnected, until
another client aborts it; an abort is answered when the arm rests; a granted session that nobody joins for
5 s is free again. Packets for other things than those below are refused: tools, frames, registers, inputs and
outputs, the override, linear and circular motions, and those with two groups.
"""

import asyncio
import json
import logging
import math
import time
from abc import ABC, abstractmethod
from typing import Any

from controllers.fanuc.data import AXES
from controllers.fanuc.simulated.controller import SnpxController
from controllers.fanuc.simulated.rmi_program import MOST_INSTRUCTIONS, Instruction, ProgramStatus
from controllers.fanuc.simulated.server import SnpxServer

logger = logging.getLogger(__name__)

MAJOR_VERSION, MINOR_VERSION = 7, 0
INITIALIZE_S = 0.1
TIMEOUT_S = 3600.0
"""Without a packet for this long, the controller ends the session; `$RMI_CFG.$DISCNT_TIM` on a real one."""

_TICK_S = 0.01
_GRANT_S = 5.0
_LONGEST_LINE = 4096
_NOT_RUNNING, _NOT_PAUSED, _BAD_COMMAND = 2556937, 2556938, 2556941
_BAD_INSTRUCTION, _BAD_VALUE, _BAD_TEXT, _BAD_POSITION = 2556948, 2556949, 2556950, 2556951
_HOLDS, _CONNECTED, _WAIT_COMMAND, _WAIT_INSTRUCTION = 2556952, 2556954, 2556955, 2556956
_BAD_SEQUENCE, _BAD_SPEED_TYPE, _BAD_SPEED, _BAD_TERM = 2556957, 2556958, 2556959, 2556960
_BAD_DESTINATION, _BAD_GROUP, _BAD_MASK = 2556964, 2556967, 2556968
_CANNOT_RESUME = 2556939
_KINDS = ("Communication", "Command", "Instruction")


class RmiServer:
    """Both listeners of RMI.

    Args:
        snpx: Server with the controller and its faults.

    Attributes:
        received: Names of all packets.
        terminate_s: Time without a packet after which a session is ended.
    """

    def __init__(self, snpx: SnpxServer) -> None:
        self.snpx = snpx
        self.session_port = 0
        self.session: Session | None = None
        self.received: list[str] = []
        self.terminate_s = TIMEOUT_S
        self._granted_s = -math.inf
        self._starting: set[_Starter] = set()

    @property
    def controller(self) -> SnpxController:
        """The controller, another one after a restart."""
        return self.snpx.controller

    def new_starter(self) -> "_Starter":
        """Return the protocol of a connection to the first port."""
        return _Starter(self, self._starting)

    def new_session(self) -> "Session":
        """Return the protocol of a connection to the port of the session."""
        return Session(self)

    def grant(self, now_s: float) -> int:
        """Return the error of FRC_Connect; 0: a session may begin."""
        if self.session is not None or now_s - self._granted_s < _GRANT_S:
            return _CONNECTED
        self._granted_s = now_s
        return 0

    def join(self, session: "Session", now_s: float) -> bool:
        """Register a session, unless none was granted."""
        if self.session is not None or now_s - self._granted_s >= _GRANT_S:
            return False
        self.session, self._granted_s = session, -math.inf
        return True

    async def run(self) -> None:
        """Move the arm and send pending packets until cancelled."""
        while True:
            now_s = time.monotonic()
            active = self.snpx.active
            if active & {"restart", "refuse"}:
                self.close()
            if "local" in active:
                self.controller.pause_rmi(now_s, fault=True)
            program = self.controller.rmi
            done = None if program is None else program.tick(now_s)
            if self.session is not None:
                self.session.tick(now_s, done)
            await asyncio.sleep(_TICK_S)

    def close(self) -> None:
        """Close all connections."""
        for each in [*self._starting]:
            each.transport.abort()
        if self.session is not None:
            self.session.transport.abort()


class _Packets(asyncio.Protocol, ABC):
    """Packets of one connection."""

    transport: asyncio.Transport

    def __init__(self, server: RmiServer) -> None:
        self._server = server
        self._rest = b""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self.transport = transport

    def data_received(self, data: bytes) -> None:
        *lines, self._rest = (self._rest + data).split(b"\r\n")
        if len(self._rest) > _LONGEST_LINE:
            self.transport.abort()
            return
        self._server.snpx.apply_faults(time.monotonic())
        for line in lines:
            if line.strip():
                self._packet(line)

    def _packet(self, line: bytes) -> None:
        kind, name, packet = _read(line)
        self._server.received.append(name)
        if "freeze" in self._server.snpx.active:
            return
        if not kind:
            self.send("Command", "Unknown", ErrorID=_BAD_TEXT)
        else:
            self.handle(kind, name, packet, time.monotonic())

    @abstractmethod
    def handle(self, kind: str, name: str, packet: dict[str, Any], now_s: float) -> None:
        """Execute and answer a packet."""

    def send(self, kind: str, name: str, **values: object) -> None:
        """Send a packet."""
        if not self.transport.is_closing():
            self.transport.write(json.dumps({kind: name, **values}).encode() + b"\r\n")


class _Starter(_Packets):
    """A connection to the first port, for FRC_Connect only."""

    def __init__(self, server: RmiServer, starting: set["_Starter"]) -> None:
        super().__init__(server)
        self._starting = starting

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self._starting.add(self)
        if self._server.snpx.active & {"refuse", "restart"}:
            self.transport.abort()

    def connection_lost(self, error: Exception | None) -> None:
        self._starting.discard(self)

    def handle(self, kind: str, name: str, packet: dict[str, Any], now_s: float) -> None:
        if name != "FRC_Connect":
            self.send(kind, name, ErrorID=_BAD_COMMAND)
        elif error := self._server.grant(now_s):
            self.send(kind, name, ErrorID=error)
        else:
            self.send(
                kind,
                name,
                ErrorID=0,
                PortNumber=self._server.session_port,
                MajorVersion=MAJOR_VERSION,
                MinorVersion=MINOR_VERSION,
            )
        self.transport.close()


class Session(_Packets):
    """The connection of the one client."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection, or close it (called by asyncio)."""
        super().connection_made(transport)
        now_s = time.monotonic()
        self._heard_s = now_s
        # A command that is not done: its name and when it may be; one at a time.
        self._pending: tuple[str, float] | None = None
        if not self._server.join(self, now_s):
            self.transport.abort()

    def connection_lost(self, error: Exception | None) -> None:
        """Free the seat; RMI_MOVE runs on (called by asyncio)."""
        if self._server.session is self:
            self._server.session = None

    def tick(self, now_s: float, done: int | None) -> None:
        """Send pending packets.

        Args:
            done: Number of an instruction that is executed now.
        """
        controller, frozen = self._server.controller, "freeze" in self._server.snpx.active
        program = controller.rmi
        if done is not None and not frozen:
            self.send("Instruction", "FRC_JointMotionJRep", ErrorID=0, SequenceID=done)
        if program is not None and program.reports_fault and not frozen:
            program.reports_fault = False
            self.send("Communication", "FRC_SystemFault", SequenceID=program.current)
        if self._pending is not None and now_s >= self._pending[1]:
            self._finish(self._pending[0], now_s)
        if now_s - self._heard_s > self._server.terminate_s:
            self.send("Communication", "FRC_Terminate")
            self.transport.close()

    def _finish(self, name: str, now_s: float) -> None:
        """End a command that takes time."""
        program = self._server.controller.rmi
        if name == "FRC_Initialize":
            error = self._server.controller.begin_rmi(now_s)
            self.send("Command", name, ErrorID=error, GroupMask=self._mask)
        elif program is None or not program.moving(now_s):
            self.send("Command", name, ErrorID=0)
        else:
            return
        self._pending = None

    @property
    def _mask(self) -> int:
        return 1 << (self._server.controller.group - 1)

    def handle(self, kind: str, name: str, packet: dict[str, Any], now_s: float) -> None:
        """Execute and answer a packet."""
        self._heard_s = now_s
        match kind:
            case "Communication" if name == "FRC_Disconnect":
                if (program := self._server.controller.rmi) is not None:
                    program.abort(now_s)
                self.send(kind, name, ErrorID=0)
                self.transport.close()
            case "Communication":
                self.send(kind, name, ErrorID=_BAD_COMMAND)
            case "Command" if self._pending is not None:
                self.send(kind, name, ErrorID=_WAIT_COMMAND)
            case "Command":
                self._command(name, packet, now_s)
            case _:
                sequence = packet.get("SequenceID")
                error = self._instruction(name, packet, now_s)
                if error:
                    self.send(kind, name, ErrorID=error, SequenceID=sequence if type(sequence) is int else 0)

    def _command(self, name: str, packet: dict[str, Any], now_s: float) -> None:
        controller = self._server.controller
        program = controller.rmi
        runs = program is not None and program.status is not ProgramStatus.ABORTED
        answer: dict[str, object] = {}
        error = 0
        match name:
            case "FRC_Initialize":
                if packet.get("GroupMask", 1) == self._mask:
                    self._pending = name, now_s + INITIALIZE_S
                    return
                error = _BAD_MASK
            case "FRC_Abort" if runs:
                assert program is not None
                program.abort(now_s)
                self._pending = name, now_s
                return
            case "FRC_Abort":
                error = _NOT_RUNNING
            case "FRC_Pause":
                error = 0 if program is not None and program.pause(now_s) else _NOT_RUNNING
            case "FRC_Continue" if program is None or not runs:
                error = _NOT_RUNNING
            case "FRC_Continue":
                ready = controller.servo_ready and not controller.pendant_enabled
                assert program is not None
                error = _CANNOT_RESUME if not ready else 0 if program.go_on() else _NOT_PAUSED
            case "FRC_Reset":
                if program is not None:
                    program.holds = False
                controller.reset(now_s)
            case "FRC_GetStatus":
                answer = self._status(controller)
            case "FRC_ReadJointAngles":
                angles = {f"J{each}": value for each, value in enumerate(controller.axes(now_s), 1)}
                answer = {"TimeTag": int(now_s * 1e3), "JointAngle": angles, "Group": controller.group}
                error = 0 if packet.get("Group", controller.group) == controller.group else _BAD_GROUP
            case "FRC_ReadError":
                answer = {"Count": 1, "ErrorData": controller.newest_alarm}
            case _:
                error = _BAD_COMMAND
        self.send("Command", name, ErrorID=error, **answer)

    def _status(self, controller: SnpxController) -> dict[str, object]:
        program = controller.rmi
        local = controller.pendant_enabled or "local" in self._server.snpx.active
        runs = program is not None and program.status is not ProgramStatus.ABORTED
        return {
            "ServoReady": int(controller.servo_ready),
            "TPMode": int(local),
            "RMIMotionStatus": int(runs),
            "ProgramStatus": int(ProgramStatus.ABORTED if program is None else program.status),
            "SingleStepMode": 0,
            "NumberUTool": 10,
            "NextSequenceID": 1 if program is None else program.expected,
            "NumberUFrame": 9,
            "Override": controller.override,
        }

    def _instruction(self, name: str, packet: dict[str, Any], now_s: float) -> int:
        """Take an instruction; return the number of its error, 0: it is answered when it is executed."""
        program = self._server.controller.rmi
        if program is None or program.status is ProgramStatus.ABORTED or self._pending is not None:
            return _NOT_RUNNING
        if program.holds:
            return _HOLDS
        if program.open >= MOST_INSTRUCTIONS:
            return _WAIT_INSTRUCTION
        found = self._parsed(name, packet, program.expected)
        if isinstance(found, int):
            program.holds = True
            return found
        program.add(found)
        return 0

    def _parsed(self, name: str, packet: dict[str, Any], expected: int) -> Instruction | int:
        if name != "FRC_JointMotionJRep":
            return _BAD_INSTRUCTION
        if type(packet.get("SequenceID")) is not int or packet["SequenceID"] != expected:
            return _BAD_SEQUENCE
        axes = _axes(packet.get("JointAngle"))
        if axes is None:
            return _BAD_POSITION
        if packet.get("SpeedType") != "Percent":
            return _BAD_SPEED_TYPE
        speed = packet.get("Speed")
        if isinstance(speed, bool) or not isinstance(speed, int | float) or not 1 <= speed <= 100:
            return _BAD_SPEED
        if packet.get("TermType") not in ("FINE", "CNT"):
            return _BAD_TERM
        target = self._server.controller.target_of(axes)
        return _BAD_DESTINATION if target is None else Instruction(expected, target, float(speed) / 100.0)


def _axes(given: object) -> list[float] | None:
    """Return nine values; the last three may be left out."""
    if not isinstance(given, dict) or given.keys() - {f"J{each}" for each in range(1, AXES + 1)}:
        return None
    values = [given.get(f"J{each}", None if each <= 6 else 0.0) for each in range(1, AXES + 1)]
    numbers = [
        float(each)
        for each in values
        if isinstance(each, int | float) and not isinstance(each, bool) and abs(each) < 1e6
    ]
    return numbers if len(numbers) == AXES else None


def _read(line: bytes) -> tuple[str, str, dict[str, Any]]:
    """Parse kind, name and values of a packet; an empty kind: invalid."""
    try:
        packet = json.loads(line)
    except (ValueError, RecursionError):
        return "", "", {}
    if not isinstance(packet, dict) or not packet:
        return "", "", {}
    kind, name = next(iter(packet.items()))
    if kind not in _KINDS or not isinstance(name, str):
        return "", "", {}
    return kind, name, packet
