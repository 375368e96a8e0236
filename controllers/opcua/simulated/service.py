"""Service of the simulated controller: an OPC UA server that refuses writes."""

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from asyncua import Server, ua

from controllers.opcua.simulated.address_space import LINEAR, ROTARY, AddressSpace
from controllers.opcua.simulated.controller import OpcUaController
from controllers.simulated.demo import demo_tour
from controllers.simulated.faults import Faults
from controllers.simulated.serving import SimulatorSettings, cannot_listen, run, warn_beyond_loopback
from robomesh.listen_address import split_address
from robots.descriptions.description import load
from robots.kinematics.joints import JointType, joints_of

OPCUA_FAULTS = (
    *("freeze", "garbage", "drop", "jump", "corrupt", "local", "fault", "mute"),
    *("restart", "refuse"),
)
"""Faults that this controller can show; the others concern other protocols."""

_TICK_S = 0.04
_STATUS_EACH_S = 0.2
_NAME = "Arm"


@dataclass(frozen=True, kw_only=True)
class OpcUaSimulatorSettings(SimulatorSettings):
    """Settings of a simulated controller with OPC UA; `path` is that of the server's address."""

    path: str = ""


async def serve_opcua(
    settings: OpcUaSimulatorSettings, *, ready: Callable[[int], None] | None = None
) -> None:
    """Simulate a controller until cancelled.

    Args:
        ready: Called with the port once clients can connect.

    Raises:
        ListenError: If it cannot listen on the address.
        SimulatorError: If a setting is invalid.
        DescriptionError: If the robot is unknown.
    """
    warn_beyond_loopback(settings.listen, insecure=settings.insecure, because="this server has no security")
    host, port = split_address(settings.listen)
    # The library reports each lost connection as an error.
    logging.getLogger("asyncua").setLevel(logging.CRITICAL)
    faults = Faults(settings.faults, known=OPCUA_FAULTS)
    simulator = await _Simulator.made(settings, faults, host, port)
    port = await simulator.start()
    try:
        if ready is not None:
            ready(port)
        await run(simulator.run(), mesh=settings.mesh, faults=faults)
    finally:
        await simulator.stop()


class _Simulator:
    """The server and its arm."""

    def __init__(
        self,
        server: Server,
        space: AddressSpace,
        boot: Callable[[bool], OpcUaController],
        faults: Faults,
        where: tuple[str, int, str],
    ) -> None:
        self._server, self._space, self._boot, self._faults = server, space, boot, faults
        self._host, self._port, self._path = where
        self._controller = boot(False)
        self._active: frozenset[str] = frozenset()
        self._written: dict[str, tuple[object, int]] = {}
        self._next_status_s = 0.0
        self._garbage = False
        self._listens = False

    @classmethod
    async def made(
        cls, settings: OpcUaSimulatorSettings, faults: Faults, host: str, port: int
    ) -> "_Simulator":
        description = load(settings.robot)
        server = Server()
        await server.init()
        server.set_server_name("robomesh (simulated controller)")
        await server.set_build_info("", "robomesh", "simulated controller", "SIM 1.0", "", datetime.now(UTC))
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        space = AddressSpace(server)
        kinds = [ROTARY if each is JointType.ROTARY else LINEAR for each in joints_of(description).types]
        await space.build(_NAME, description.name, kinds)

        def boot(restarted: bool) -> OpcUaController:
            tour = demo_tour(description) if settings.demo and not restarted else None
            return OpcUaController(description, tour=tour)

        return cls(server, space, boot, faults, (host, port, settings.path.lstrip("/")))

    # ----------------------------------------------------------------------- listening

    async def start(self) -> int:
        """Listen; return the port."""
        host = f"[{self._host}]" if ":" in self._host else self._host
        self._server.set_endpoint(f"opc.tcp://{host}:{self._port}/{self._path}".rstrip("/"))
        try:
            await self._server.start()
        except OSError as error:
            raise cannot_listen(f"{self._host}:{self._port}", error) from None
        self._listens = True
        self._port = self._sockets.sockets[0].getsockname()[1]
        return self._port

    async def stop(self) -> None:
        """Listen no more, and end all connections."""
        if self._listens:
            self._listens = False
            await self._server.stop()

    @property
    def _sockets(self) -> Any:
        assert self._server.bserver is not None
        return self._server.bserver._server

    @property
    def _transports(self) -> list[Any]:
        return [*self._server.iserver.asyncio_transports]

    # --------------------------------------------------------------------------- state

    async def run(self) -> None:
        """Move the arm, and write its state into the server, until cancelled."""
        while True:
            now_s = time.monotonic()
            self._controller.tick(now_s)
            await self._apply_faults(now_s)
            if "freeze" not in self._active and self._listens:
                await self._write_state(now_s)
            await asyncio.sleep(_TICK_S)

    async def _apply_faults(self, now_s: float) -> None:
        if self._listens and self._transports:
            self._faults.first_client(now_s)
        self._active, begun, ended = self._faults.changes(self._active, now_s)
        if "fault" in begun:
            self._controller.protective_stop(now_s)
        if "restart" in begun:
            self._controller = self._boot(True)
        if "fault" in ended:
            self._controller.go_on(now_s)
        if "freeze" in self._active | ended:
            for transport in self._transports:
                # New connections too; a second call has no effect.
                (transport.pause_reading if "freeze" in self._active else transport.resume_reading)()
        if self._active & {"refuse", "restart"}:
            self._close_listener()
            self._drop()
        elif not self._listens_now():
            await self._open_listener()
        if self._faults.drops(now_s):
            self._drop()

    def _drop(self) -> None:
        for transport in self._transports:
            transport.abort()

    def _listens_now(self) -> bool:
        return bool(self._sockets.is_serving())

    def _close_listener(self) -> None:
        if self._listens_now():
            self._sockets.close()

    async def _open_listener(self) -> None:
        assert self._server.bserver is not None
        self._server.bserver.port = self._port
        await self._server.bserver.start()

    async def _write_state(self, now_s: float) -> None:
        """Write what has changed; all axes have one time."""
        at = datetime.now(UTC)
        active = self._active
        self._garbage = "garbage" in active and not self._garbage
        status = ua.StatusCodes.BadSensorFailure if self._garbage else ua.StatusCodes.Good
        axes = self._controller.axes(now_s, active)
        await self._write({name: float("nan") for name in axes} if self._garbage else axes, at, status)
        if now_s >= self._next_status_s:
            self._next_status_s = now_s + _STATUS_EACH_S
            code = ua.StatusCodes.BadNoCommunication if "mute" in active else ua.StatusCodes.Good
            await self._write(self._controller.status(now_s, active), at, code)

    async def _write(self, values: Mapping[str, Any], at: datetime, status: int) -> None:
        for name, value in values.items():
            if self._written.get(name) == (value, status):
                continue
            self._written[name] = value, status
            node = self._space.variables[name]
            variant = ua.Variant(value, _TYPES.get(type(value), ua.VariantType.Int32))
            data = ua.DataValue(variant, ua.StatusCode(status), SourceTimestamp=at)
            await self._server.iserver.write_attribute_value(node.nodeid, data)


_TYPES = {float: ua.VariantType.Double, bool: ua.VariantType.Boolean, str: ua.VariantType.String}
