"""Server of one simulated controller: clients of RTDE with their own recipes, of the primary interface for
reading and for scripts, and of the dashboard.

What documents leave open is decided here: a frequency outside the permitted range is brought into it, a start
without a valid recipe is refused, and a client that reads nothing for 10 s is closed.
"""

import asyncio
import itertools
import logging
import math
import struct
import time
from collections.abc import Callable, Mapping

from controllers.simulated import faults as effects
from controllers.simulated.fault_table import displacement
from controllers.simulated.faults import Faults
from controllers.universal_robots.interfaces import rtde_messages as rtde
from controllers.universal_robots.interfaces.modes import TextLevel
from controllers.universal_robots.interfaces.packages import Malformed, Package, PackageStream
from controllers.universal_robots.interfaces.primary import PrimaryMessage
from controllers.universal_robots.interfaces.rtde_messages import (
    IN_USE,
    LONGEST_PACKAGE_BYTES,
    NOT_FOUND,
    ControllerVersion,
    PackageType,
    Recipe,
)
from controllers.universal_robots.simulated import dashboard, messages
from controllers.universal_robots.simulated.controller import UrController
from controllers.universal_robots.simulated.fields import INPUTS, NOT_ON_CB3, OFFERED
from controllers.universal_robots.simulated.script.code import LONGEST_SOURCE

logger = logging.getLogger(__name__)

UR_FAULTS = (
    *("freeze", "garbage", "split", "flood", "deluge", "drop"),
    *("jump", "corrupt", "local", "fault", "restart", "refuse", "burst"),
)
"""Faults that this controller can show; the others concern units or commands."""

_TICK_S = 0.01
_PRIMARY_S = 0.1
_PATIENCE_S = 10.0
_HOLD_BACK_S = 2.0
_PAUSE_S = 0.001
_LONGEST_BUFFER_BYTES = 4 * 1024 * 1024
_GARBAGE_EACH = 10
# Each breaks another rule but keeps the framing, so that a reader can go on.
_GARBAGE = (
    rtde.HEADER.pack(3 + 2, PackageType.DATA) + b"\x01\x00",
    rtde.HEADER.pack(3 + 4, ord("?")) + b"\xff\xfe\x00\x1b",
    rtde.HEADER.pack(3 + 3, PackageType.TEXT) + b"\xf0ab",
    rtde.HEADER.pack(3 + 9, PackageType.DATA) + b"\xfe" + struct.pack(">d", math.nan),
)


class UrServer:
    """Server of one controller.

    Args:
        boot: Creates the controller after a restart, without power, for the time now.
        version: Version of its software; 3 is CB3.
        taken: Input fields that a fieldbus of the controller writes: IN_USE for every client.
    """

    def __init__(
        self,
        boot: Callable[[float, bool, Callable[[PrimaryMessage], None]], UrController],
        fault_schedule: Faults,
        *,
        version: ControllerVersion,
        taken: frozenset[str] = frozenset(),
    ) -> None:
        self._boot = boot
        self._faults = fault_schedule
        self.version = version
        self._taken = taken
        self.rtde_clients: set[RtdeClient] = set()
        self._monitors: set[PrimaryMonitor] = set()
        self._dashboards: set[DashboardClient] = set()
        self.active: frozenset[str] = frozenset()
        self.controller = boot(time.monotonic(), False, self._announce)

    # --------------------------------------------------------------------------- clients

    def new_rtde_client(self) -> "RtdeClient":
        """Return the protocol of an RTDE connection."""
        return RtdeClient(self)

    def new_monitor(self) -> "PrimaryMonitor":
        """Return the protocol of a connection of the primary interface."""
        return PrimaryMonitor(self)

    def new_script_client(self) -> "ScriptClient":
        """Return the protocol of a connection of the primary interface that takes scripts."""
        return ScriptClient(self)

    def new_dashboard_client(self) -> "DashboardClient":
        """Return the protocol of a connection of the dashboard."""
        return DashboardClient(self)

    def admit(self, client: "Connection") -> bool:
        """Register a connection, unless a fault forbids it."""
        now_s = time.monotonic()
        self._faults.first_client(now_s)
        self.apply_faults(now_s)
        if self.active & {"refuse", "restart"}:
            client.abort()
            return False
        match client:
            case RtdeClient():
                self.rtde_clients.add(client)
            case PrimaryMonitor():
                self._monitors.add(client)
            case DashboardClient():
                self._dashboards.add(client)
        logger.info("%s connected", client.name)
        return True

    def remove(self, client: "Connection") -> None:
        """Forget a connection that has ended."""
        for group in (self.rtde_clients, self._monitors, self._dashboards):
            group.discard(client)

    def input_type(self, name: str, client: "RtdeClient") -> str:
        """Return the answer to a set-up of one input."""
        if name not in INPUTS:
            return NOT_FOUND
        others = (each for each in self.rtde_clients if each is not client)
        return IN_USE if name in self._taken or any(name in each.inputs for each in others) else INPUTS[name]

    def output_type(self, name: str) -> str:
        """Return the answer to a set-up of one output."""
        if self.version.major < 5 and name in NOT_ON_CB3:
            return NOT_FOUND
        return OFFERED.get(name, NOT_FOUND)

    # ----------------------------------------------------------------------------- run

    async def run(self) -> None:
        """Move the arm and send the primary interface's states until cancelled."""
        next_state_s = 0.0
        while True:
            now_s = time.monotonic()
            self.controller.tick(now_s)
            self.apply_faults(now_s)
            if now_s >= next_state_s:
                next_state_s = now_s + _PRIMARY_S
                state = messages.robot_state(self.controller, now_s)
                self._send_to_monitors(state * min(effects.copies(self.active), 50))
            await asyncio.sleep(_TICK_S)

    def close(self) -> None:
        """Close every connection."""
        for client in (*self.rtde_clients, *self._monitors, *self._dashboards):
            client.abort()

    def _announce(self, message: PrimaryMessage) -> None:
        self._send_to_monitors(messages.robot_message(message))

    def _send_to_monitors(self, data: bytes) -> None:
        if "freeze" not in self.active:
            for monitor in tuple(self._monitors):
                monitor.send(data)

    # --------------------------------------------------------------------------- faults

    def apply_faults(self, now_s: float) -> None:
        """Update the active faults, and apply their effects on connections and controller."""
        self.active, begun, ended = self._faults.changes(self.active, now_s)
        for name in begun:
            self._begin(name, now_s)
        if "fault" in ended:
            self.controller.end_protective_stop(now_s)
        if "freeze" in ended:
            for client in (*self.rtde_clients, *self._monitors, *self._dashboards):
                client.pause_reading(False)
        if "local" in ended:
            self.controller.remote = True
        if self._faults.drops(now_s):
            self.close()

    def _begin(self, name: str, now_s: float) -> None:
        match name:
            case "freeze":
                for client in (*self.rtde_clients, *self._monitors, *self._dashboards):
                    client.pause_reading(True)
            case "local":
                self.controller.remote = False
                for monitor in tuple(self._monitors):
                    monitor.lose_control()
            case "fault":
                self.controller.protective_stop(now_s)
            case "restart":
                self.close()
                self.controller = self._boot(now_s, True, self._announce)
            case "refuse":
                self.close()


class Connection(asyncio.Protocol):
    """A client's connection; a client that reads nothing for 10 s is closed."""

    _transport: asyncio.Transport

    def __init__(self, server: UrServer) -> None:
        self._server = server
        self._behind: asyncio.TimerHandle | None = None

    @property
    def name(self) -> str:
        """Address of the client, for logs."""
        host, port, *_ = self._transport.get_extra_info("peername") or ("-", 0)
        return f"{type(self).__name__} {host}:{port}"

    @property
    def behind(self) -> bool:
        """True while the client has not read what was sent."""
        return self._behind is not None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Register the connection."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.set_write_buffer_limits(high=0)
        if self._server.admit(self):
            self.admitted()

    def admitted(self) -> None:
        """Handle the begin of the connection."""

    def connection_lost(self, error: Exception | None) -> None:
        """Forget the connection."""
        self.resume_writing()
        self._server.remove(self)
        logger.info("%s disconnected", self.name)

    def pause_writing(self) -> None:
        """Start the timeout of a client that does not read."""
        if self._behind is None:
            self._behind = asyncio.get_running_loop().call_later(_PATIENCE_S, self._drop)

    def resume_writing(self) -> None:
        """End the timeout: the socket has taken everything."""
        if self._behind is not None:
            self._behind.cancel()
            self._behind = None

    def write(self, data: bytes) -> None:
        """Write data, unless the connection ends or the client leaves megabytes unread."""
        if not self._transport.is_closing():
            if self._transport.get_write_buffer_size() > _LONGEST_BUFFER_BYTES:
                self._drop()
            else:
                self._transport.write(data)

    def pause_reading(self, paused: bool) -> None:
        """Stop or continue reading."""
        if not self._transport.is_closing():
            (self._transport.pause_reading if paused else self._transport.resume_reading)()

    def abort(self) -> None:
        """Close the connection immediately."""
        self._transport.abort()

    def _drop(self) -> None:
        logger.warning("%s does not read: closed", self.name)
        self.abort()


class PrimaryMonitor(Connection):
    """A client of the primary interface; what it sends is ignored, as on the read-only port 30011."""

    def admitted(self) -> None:
        """Send the version of the software."""
        self.write(messages.robot_message(messages.primary_version(self._server.version)))

    def send(self, data: bytes) -> None:
        """Send data to a client that reads."""
        if not self.behind:
            self.write(data)

    def lose_control(self) -> None:
        """Handle the change to local control."""


class ScriptClient(PrimaryMonitor):
    """A client of the primary interface on port 30001; the controller executes its scripts.

    A connection opened in local control only reads; remote control needs a new one.
    """

    def __init__(self, server: UrServer) -> None:
        super().__init__(server)
        self._text = ""
        self._lines: list[str] = []
        self._executes = server.controller.remote

    def lose_control(self) -> None:
        """Close the connection, as controllers do when they change to local control."""
        if self._executes:
            self.abort()

    def data_received(self, data: bytes) -> None:
        """Start the programs in the next bytes."""
        *lines, self._text = (self._text + data.decode("latin-1")).split("\n")
        for line in lines:
            self._take(line.rstrip())
        if len(self._text) + sum(map(len, self._lines)) > LONGEST_SOURCE:
            logger.info("%s sends a script that is too long", self.name)
            self.abort()

    def _take(self, line: str) -> None:
        if not self._lines and not line.strip():
            return
        self._lines.append(line)
        # A program ends with an "end" at the begin of a line; other lines are programs by themselves.
        if line == "end" or not self._lines[0].startswith(("def ", "sec ")):
            source = "\n".join(self._lines)
            self._lines = []
            now_s = time.monotonic()
            if self._executes:
                self._server.controller.take_script(source, now_s)
            else:
                self._server.controller.refuse_script(now_s)


class DashboardClient(Connection):
    """A client of the dashboard server."""

    def __init__(self, server: UrServer) -> None:
        super().__init__(server)
        self._text = ""
        self._remote = server.controller.remote

    def admitted(self) -> None:
        """Greet."""
        self._say(dashboard.GREETING)

    def data_received(self, data: bytes) -> None:
        """Execute the commands in the next bytes."""
        *lines, self._text = (self._text + data.decode("latin-1")).split("\n")
        for line in lines:
            now_s = time.monotonic()
            self._say(
                dashboard.answer(
                    line, self._server.controller, self._server.version, remote=self._remote, now_s=now_s
                )
            )
            if line.strip() == "quit":
                self._transport.close()
                return
        if len(self._text) > dashboard.LONGEST_COMMAND:
            self.abort()

    def _say(self, words: str) -> None:
        self.write(f"{words}\n".encode("latin-1", "replace"))


class RtdeClient(Connection):
    """A client of RTDE.

    Attributes:
        inputs: Names of the input fields that it has set up.
    """

    def __init__(self, server: UrServer) -> None:
        super().__init__(server)
        self._packages = PackageStream(rtde.HEADER.format, longest=LONGEST_PACKAGE_BYTES)
        self._version = 1
        self._recipe: Recipe | None = None
        self._period_s = 1.0 / server.version.highest_hz
        self._input_recipes: dict[int, Recipe] = {}
        self._sending: asyncio.Task[None] | None = None
        self.inputs: set[str] = set()

    def admitted(self) -> None:
        """Read nothing while the controller is frozen."""
        self.pause_reading("freeze" in self._server.active)

    def connection_lost(self, error: Exception | None) -> None:
        """Forget the connection and its inputs."""
        self._pause()
        super().connection_lost(error)

    def data_received(self, data: bytes) -> None:
        """Answer the requests in the next bytes."""
        for event in self._packages.receive(data):
            if isinstance(event, Malformed):
                self._complain(event.reason)
            else:
                self._answer(event)
        if self._packages.lost:
            self.abort()

    def _complain(self, words: str, level: TextLevel = TextLevel.ERROR) -> None:
        logger.info("%s: %s", self.name, words)
        self.write(messages.text(words, level, self._version))

    def _answer(self, request: Package) -> None:
        payload = request.payload
        match request.type:
            case PackageType.PROTOCOL_VERSION if len(payload) == 2:
                version = int.from_bytes(payload, "big")
                if version in (1, 2):
                    self._version = version
                self.write(messages.accepted(PackageType.PROTOCOL_VERSION, version in (1, 2)))
            case PackageType.URCONTROL_VERSION:
                self.write(messages.version(self._server.version))
            case PackageType.SET_UP_OUTPUTS:
                self._set_up_outputs(payload)
            case PackageType.SET_UP_INPUTS:
                self._set_up_inputs(payload)
            case PackageType.START:
                if self._recipe is not None and self._sending is None:
                    self._sending = asyncio.get_running_loop().create_task(self._send())
                self.write(messages.accepted(PackageType.START, self._recipe is not None))
            case PackageType.PAUSE:
                self._pause()
                self.write(messages.accepted(PackageType.PAUSE, True))
            case PackageType.DATA:
                self._write_inputs(payload)
            case PackageType.TEXT:
                self._log(payload)
            case _:
                self._complain(f"a package of type {request.type} with {len(payload)} bytes is not a request")

    def _set_up_outputs(self, payload: bytes) -> None:
        self._pause()
        self._recipe = None
        highest_hz = self._server.version.highest_hz
        frequency_hz = highest_hz
        if self._version > 1:
            if len(payload) < 8:
                self._complain("a set-up of outputs begins with a frequency")
                return
            (wanted_hz,) = struct.unpack_from(">d", payload)
            frequency_hz = min(max(wanted_hz, 1.0), highest_hz) if math.isfinite(wanted_hz) else highest_hz
            payload = payload[8:]
        self._period_s = 1.0 / frequency_hz
        names = _names(payload)
        types = [self._server.output_type(name) for name in names]
        unknown = [name for name, kind in zip(names, types, strict=True) if kind == NOT_FOUND]
        if unknown:
            logger.info("%s asks for unknown fields: %s", self.name, ", ".join(unknown)[:200])
        valid = not unknown
        number = int(valid) if self._version > 1 else None
        if valid:
            self._recipe = Recipe(names, types, number)
        self._answer_set_up(PackageType.SET_UP_OUTPUTS, number, types)

    def _set_up_inputs(self, payload: bytes) -> None:
        names = _names(payload)
        types = [self._server.input_type(name, self) for name in names]
        number = 0
        if all(kind in rtde.FORMATS for kind in types) and len(self._input_recipes) < 255:
            number = len(self._input_recipes) + 1
            self._input_recipes[number] = Recipe(names, types, number)
            self.inputs.update(names)
        self._answer_set_up(PackageType.SET_UP_INPUTS, number, types)

    def _answer_set_up(self, kind: PackageType, number: int | None, types: list[str]) -> None:
        try:
            answer = messages.set_up(kind, number, types)
        except ValueError as error:
            self._complain(f"{len(types)} fields are too many: {error}")
        else:
            self.write(answer)

    def _write_inputs(self, payload: bytes) -> None:
        recipe = self._input_recipes.get(payload[0]) if payload else None
        if recipe is None:
            self._complain("data for an input recipe that is not set up")
            return
        try:
            values: Mapping[str, rtde.Value] = recipe.read(payload)
        except ValueError as error:
            self._complain(str(error))
            return
        self._server.controller.write(values, time.monotonic())

    def _log(self, payload: bytes) -> None:
        try:
            logger.info("%s: %s", self.name, rtde.read_text(payload, self._version).text)
        except ValueError as error:
            self._complain(str(error))

    # ------------------------------------------------------------------------- data

    def _pause(self) -> None:
        if self._sending is not None:
            self._sending.cancel()
            self._sending = None

    async def _send(self) -> None:
        """Send data until cancelled. A client that is behind misses packages; it gets no old ones."""
        next_s = time.monotonic()
        held_back: list[bytes] = []
        since_s = next_s
        for number in itertools.count():
            now_s = time.monotonic()
            active = self._server.active
            if "freeze" not in active and not self.behind:
                data = self._data(now_s, number, active)
                if "burst" in active:
                    held_back.append(data)
                    data = b""
                if held_back and ("burst" not in active or now_s - since_s >= _HOLD_BACK_S):
                    data = b"".join(held_back) + data
                    held_back, since_s = [], now_s
                if "split" in active:
                    for piece in effects.pieces(data):
                        self.write(piece)
                        await asyncio.sleep(_PAUSE_S)
                elif data:
                    self.write(data * effects.copies(active))
            next_s = max(next_s + self._period_s, now_s)
            await asyncio.sleep(next_s - time.monotonic())

    def _data(self, now_s: float, number: int, active: frozenset[str]) -> bytes:
        assert self._recipe is not None
        leap = displacement(active, now_s)
        values = self._server.controller.values(self._recipe.names, now_s, leap_deg=leap)
        data = rtde.package(PackageType.DATA, self._recipe.write(values))
        index, rest = divmod(number, _GARBAGE_EACH)
        return _GARBAGE[index % len(_GARBAGE)] + data if "garbage" in active and not rest else data


def _names(data: bytes) -> list[str]:
    """Return the names of a set-up; ur_rtde ends them with a comma, which controllers accept."""
    return data.decode("ascii", "replace").removesuffix(",").split(",")
