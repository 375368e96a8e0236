"""Drivers that move a robot, each with its simulated controller, for the conformance suite of motion.

What a gateway has sent is read from the wire, by readings of its bytes that no driver shares.
"""

import asyncio
import contextlib
import json
import math
import re
import struct
import time
from dataclasses import replace
from typing import ClassVar

import pytest

from controllers.unit.simulated import service as unit_service
from controllers.universal_robots import motion_script
from controllers.universal_robots.interfaces.modes import RuntimeState
from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from controllers.yaskawa.data import Status1
from controllers.yaskawa.motion_driver import HsesMotionDriver
from protocol_gateway.gateway import RobotSettings
from robomesh.errors import RefusedError
from robomesh.schemas import robomesh_pb2 as schema
from tests.controllers.fanuc import fanuc_site
from tests.controllers.simulated_site import kept
from tests.controllers.universal_robots import ur_site
from tests.controllers.yaskawa import hses_site
from tests.protocol_gateway import gateway_site
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, until
from tests.protocol_gateway.wire import wire

NONE, NOT_NOW, OURS, ANY = (getattr(schema.Capabilities, each) for each in ("NONE", "NOT_NOW", "OURS", "ANY"))


class Mover:
    """A robot that a gateway moves, between both a wire for each port.

    Attributes:
        robot: Settings of the robot.
        ports: Names of the ports after the first, as in the site file.
        stops, local_stops: Motion that a stop request ends in remote, and in local control.
        causes: Code of the cause of the latched stop, by scenario.
        dies_with_link: As the driver declares: the controller ends a motion without its gateway.
        allowed: Words of all commands that may be sent.
        replaces: A motion that runs, also another client's, is replaced by a new one.
        watches: The driver follows its motion, and has a stop latched if anything is not as expected.
        seat: What is said while another client has the seat.
        hazards: Events within a motion that only this controller has: begin, end, code of the stop.
        impossible: Scenarios that the protocol does not have, with the reason.
    """

    name = ""
    robot: ClassVar[dict] = {}
    ports = ()
    datagrams = False
    stops = local_stops = ANY
    dies_with_link = None
    allowed = frozenset({"move", "stop"})
    replaces = False
    watches = True
    fault_is_shown_as = STATE.FAULT
    crawls_percent = 3
    seat = ""
    impossible: ClassVar[dict] = {}
    causes: ClassVar[dict] = {}
    hazards: ClassVar[dict] = {}

    def __init__(self, site, wires, server):
        self.site, self.wires, self.server = site, wires, server

    @classmethod
    @contextlib.asynccontextmanager
    async def wired(cls, monkeypatch):
        """Run a controller, and a wire to each of its ports; yield its server and the wires."""
        async with contextlib.AsyncExitStack() as stack:
            ports, server = await stack.enter_async_context(cls.controller(monkeypatch))
            cls.settle(server)
            yield (
                server,
                {
                    name: await stack.enter_async_context(wire(port, datagrams=cls.datagrams))
                    for name, port in zip(("", *cls.ports), ports, strict=True)
                },
            )

    @classmethod
    @contextlib.asynccontextmanager
    async def started(cls, mesh, folder, monkeypatch, *, prepare=lambda server: None, **robot):
        """Run controller, wires and gateway; yield the mover.

        Args:
            prepare: Called with the controller's server before the gateway connects.
        """
        async with cls.wired(monkeypatch) as (server, wires):
            prepare(server)
            others = {"ports": {name: wires[name].port for name in cls.ports}, "simulated": True}
            async with gateway(mesh, folder, wires[""].port, **cls.robot | others | robot) as site:
                yield cls(site, wires, server)

    def settings(self):
        """Return the settings of the robot for a gateway in another process."""
        robot = {"description": "pt600", "stop_proven": True, **self.robot, "simulated": True}
        robot.pop("up", None)
        ports = {name: self.wires[name].port for name in self.ports}
        return RobotSettings(name=self.name, host="127.0.0.1", port=self.wires[""].port, ports=ports, **robot)

    @staticmethod
    def controller(monkeypatch):
        """Run a controller with a program of its own; yield its ports and its server."""
        raise NotImplementedError

    @staticmethod
    def settle(server):
        """Hold the controller's own program back, until `start_foreign`."""

    # ------------------------------------------------------------------------ the gateway

    async def in_control(self):
        """Take control as soon as motion is possible."""
        site = self.site
        await until(lambda: site.seen.get("controller") and site.controller.mode == STATE.REMOTE)
        await until(lambda: site.joints)
        await site.lease(A.RENEW if site.secret else A.ACQUIRE)
        await until(lambda: site.controller.capabilities.stops == self.stops)

    async def move(self, by, **fields):
        """Command a target for the first joint; return all targets."""
        here = self.positions()
        target = [here[0] + by, *here[1:]]
        await self.site.command(C.MOVE_ABSOLUTE, joint_positions=target, **fields)
        return target

    async def begin(self, by=1.5, percent=20):
        """Take control, and command a slow motion; return its targets when the arm has moved."""
        await self.in_control()
        await self.site.command(C.SPEED, speed_percent=percent)
        here = self.positions()
        target = await self.moved(by)
        await until(lambda: abs(self.positions()[0] - here[0]) > 0.01)
        return target

    async def crawl(self):
        """Move as slowly as the arm can, after a stop again."""
        if self.site.controller.HasField("stop"):
            await self.reset()
        await self.site.command(C.SPEED, speed_percent=self.crawls_percent)
        here = self.positions()
        await self.moved(2.0)
        await until(lambda: abs(self.positions()[0] - here[0]) > 0.01)

    async def moved(self, by):
        """Command a motion as soon as it is taken, which a controller's state may need a moment for."""
        async with asyncio.timeout(30.0):
            while True:
                await self.site.lease(A.RENEW)
                with contextlib.suppress(RefusedError):
                    return await self.move(by)
                await asyncio.sleep(0.05)

    async def reset(self):
        """Reset the latched stop, as the manual of the controller says."""
        await until(lambda: self.site.controller.activity in (STATE.IDLE, STATE.STOPPED))
        await self.site.lease(A.RENEW)
        await self.site.command(C.RESET, stop_id=self.site.controller.stop.id)

    # ------------------------------------------------------------------------ the controller

    @property
    def arm(self):
        """Model of the controller, another one after a restart."""
        return self.server.controller

    def positions(self):
        """Return the joint positions [rad]."""
        return self.arm.positions(time.monotonic()).tolist()

    def fault(self, name):
        self.server._faults.begin(name, time.monotonic())

    def end_fault(self, name):
        self.server._faults.end(name)

    def go_local(self):
        self.fault("local")

    def go_remote(self):
        self.end_fault("local")

    # -------------------------------------------------------------------------------- the wire

    def words(self):
        """Return the words of all commands that were sent, in their order on each wire."""
        raise NotImplementedError

    @property
    def motions(self):
        """Number of motions that were sent."""
        return self.words().count("move")

    def keep_back(self):
        """Keep the next motion back, and what follows it on its wire; return what releases it."""
        raise NotImplementedError

    @staticmethod
    def corrupted(data):
        """Return bytes of the controller with another position of the first joint, if there is one."""
        raise NotImplementedError

    def corrupt(self, times=1):
        """Corrupt that many of the next positions."""

        def answers(data):
            nonlocal times
            changed = self.corrupted(data) if times else data
            times -= changed != data
            return [changed]

        self.wires[""].answers = answers


class UnitMover(Mover):
    name = "unit"
    robot: ClassVar[dict] = {}
    allowed = frozenset({"move", "stop", "reset", "speed="})
    replaces = True
    watches = False
    seat = "too many clients"
    impossible: ClassVar[dict] = {
        "tool": "the unit protocol reports neither tool nor payload",
        "reply": "the unit protocol has no replies: states are sent all the time",
        "stop channel": "one connection carries all",
        "datagrams": "TCP neither doubles nor reorders",
    }

    @staticmethod
    @contextlib.asynccontextmanager
    async def controller(monkeypatch):
        servers = kept(monkeypatch, unit_service, "_server")
        async with gateway_site.simulator() as port:
            yield (port,), servers[-1]

    @staticmethod
    def settle(server):
        server._controller._homed = True

    @property
    def arm(self):
        return self.server._controller

    def positions(self):
        return self.arm._motion.state(time.monotonic()).positions.tolist()

    def moves(self):
        return self.arm._motion.moving(time.monotonic())

    def words(self):
        found = []
        for each in self.wires[""].data.split(b"@"):
            if command := re.search(rb"COMMAND\*(.*)", each):
                found += re.sub(r"=.*", "=", command[1].decode()).split(";")
            elif b"ABSOLUTE.DEG*" in each or b"RELATIVE.DEG*" in each:
                found.append("move")
        return found

    def keep_back(self):
        self.wires[""].keep_back(lambda data: b"ABSOLUTE.DEG" in data)
        return self.wires[""].release

    @staticmethod
    def corrupted(data):
        return re.sub(rb"(ABSOLUTE.DEG\*-?)", rb"\g<1>9", data, count=1)

    async def _say(self, text):
        """Send a unit as another client."""
        await say(self.wires[""].target, text)

    async def start_foreign(self):
        target = [math.degrees(each) for each in self.positions()]
        values = ";".join(f"{each:.4f}" for each in [target[0] + 60.0, *target[1:]])
        await self._say(f"1#ABSOLUTE.DEG*{values}@".encode())

    foreign_runs = moves

    async def end_foreign(self):
        await self._say(b"1#COMMAND*stop@")
        await self._say(b"1#COMMAND*reset@")

    async def stop_elsewhere(self):
        await self._say(b"1#COMMAND*stop@")

    async def slow_down(self):
        await self._say(b"1#COMMAND*speed=10@")

    @staticmethod
    def take_seat(server):
        server._faults.begin("refuse", time.monotonic())

    def free_seat(self):
        self.end_fault("refuse")


async def say(port, text):
    """Send a text as another client."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(text)
    writer.write_eof()
    # Closed with an answer that nobody read, the connection would be reset, and the text might be lost.
    await reader.read()
    writer.close()


async def replaced(arm):
    """Let another client start a program."""
    _, writer = await asyncio.open_connection("127.0.0.1", arm.wires["scripts"].target)
    writer.write(b"def other():\n  while True:\n    sync()\n  end\nend\n")
    await writer.drain()
    await until(lambda: arm.site.controller.HasField("stop"))
    writer.close()


async def paused(arm):
    arm.arm.programs.pause(time.monotonic())


async def tool_set_by_a_script(arm):
    arm.arm.take_script("sec tool():\n  set_tcp(p[0,0,0.3,0,0,0])\nend", time.monotonic())


class UrMover(Mover):
    name = "rtde"
    robot: ClassVar[dict] = {**ur_site.UR, "options": UniversalRobotsSettings(motion=MotionSettings())}
    ports = ("primary", "scripts", "dashboard")
    local_stops = OURS
    fault_is_shown_as = STATE.STOPPED
    crawls_percent = 20
    dies_with_link = True
    allowed = frozenset({"move", "stop", "go", "no go"})
    causes: ClassVar[dict] = {
        each: f"universal_robots.{code}"
        for each, code in {
            "local": "went_local",
            "tool": "tool_changed",
            "stop channel": "channel_lost",
            "late": "not_started",
            "fault": "arm_stopped",
        }.items()
    }
    seat = "input_int_register_25"
    hazards: ClassVar[dict] = {
        "replaced": (
            replaced,
            lambda arm: arm.arm.programs.stop(time.monotonic()),
            "universal_robots.lost_program",
        ),
        "paused": (paused, lambda arm: None, "universal_robots.paused"),
        "set_tcp": (tool_set_by_a_script, lambda arm: None, "universal_robots.tool_changed"),
    }
    impossible: ClassVar[dict] = {
        "reply": "a program has no reply: its registers are part of each state",
        "datagrams": "TCP neither doubles nor reorders",
        "axes": "its controllers have six axes",
    }

    @staticmethod
    @contextlib.asynccontextmanager
    async def controller(monkeypatch):
        # Gateway and controller share one event loop here: let a busy machine be late.
        monkeypatch.setattr(motion_script, "WATCHDOG_HZ", 1)
        async with ur_site.controller(monkeypatch, demo=True) as (ports, server):
            yield (ports.rtde, *ur_site.others(ports).values()), server

    @staticmethod
    def settle(server):
        server.controller.programs.stop(time.monotonic())

    def positions(self):
        return self.arm.programs.arm(time.monotonic()).positions.tolist()

    def moves(self):
        return self.arm.programs.moving(time.monotonic())

    def words(self):
        found = ["move"] * self.wires["scripts"].data.count(b"movej(")
        lines = self.wires["dashboard"].data.decode().splitlines()
        found += [each for each in lines if each != "is in remote control"]
        for part in self.wires[""].sent:
            while part:
                size, kind = struct.unpack_from(">HB", part)
                if kind == ord("U"):
                    _, go, _ = struct.unpack(">Bii", part[3:size])
                    found.append("go" if go else "no go")
                part = part[size:]
        return found

    def keep_back(self):
        self.wires["scripts"].keep_back()
        return self.wires["scripts"].release

    @staticmethod
    def corrupted(data):
        # A package of data: size, "U", recipe, time; the exponent of a double.
        return data[:12] + b"\x40\xe2" + data[14:] if data[2:3] == b"U" else data

    async def start_foreign(self):
        self.arm.programs.play(time.monotonic())

    def foreign_runs(self):
        return self.arm.programs.state is RuntimeState.PLAYING

    async def end_foreign(self):
        self.arm.programs.stop(time.monotonic())

    async def stop_elsewhere(self):
        await say(self.wires["dashboard"].target, b"stop\n")

    async def slow_down(self):
        self.arm.write({"speed_slider_mask": 1, "speed_slider_fraction": 0.5}, time.monotonic())

    def change_tool(self):
        before, self.arm.payload_kg = self.arm.payload_kg, 4.0
        return lambda: setattr(self.arm, "payload_kg", before)

    def cut_stop(self):
        self.wires["dashboard"].cut()

    async def mend_stop(self):
        await self.wires["dashboard"].open()

    @staticmethod
    def take_seat(server):
        server._taken = frozenset({"input_int_register_25"})

    def free_seat(self):
        self.server._taken = frozenset()


async def held(arm):
    arm.arm.press_hold(time.monotonic())


async def without_servos(arm):
    arm.arm.switch_servos(False, time.monotonic())


class HsesMover(Mover):
    name = "hses"
    robot: ClassVar[dict] = hses_site.HSES
    ports = ("stop",)
    datagrams = True
    local_stops = NOT_NOW
    dies_with_link = False
    allowed = frozenset({"move", "stop", "end of hold"})
    causes: ClassVar[dict] = {
        each: f"hses.{code}"
        for each, code in {
            "local": "went_local",
            "tool": "tool_changed",
            "stop channel": "channel_lost",
            "late": "not_started",
            "fault": "arm_stopped",
            "stop of others": "held",
        }.items()
    }
    hazards: ClassVar[dict] = {
        "held": (held, lambda arm: setattr(arm.arm, "held_at_pendant", False), "hses.held"),
        "servos": (
            without_servos,
            lambda arm: arm.arm.switch_servos(True, time.monotonic()),
            "hses.arm_stopped",
        ),
    }
    impossible: ClassVar[dict] = {
        "override": "how an override changes a motion by command is not known, so it is not simulated",
        "seat": "HSES has no sessions: it answers every client",
    }

    @staticmethod
    @contextlib.asynccontextmanager
    async def controller(monkeypatch):
        # On a controller all sockets are one port.
        monkeypatch.setattr(HsesMotionDriver, "ports", frozenset({"stop"}))
        async with hses_site.controller(monkeypatch, demo=True, held_motions_go_on=True) as (port, server):
            yield (port, port), server

    @staticmethod
    def settle(server):
        server.controller.press_hold(time.monotonic())
        server.controller.held_at_pendant = False

    def settings(self):
        return replace(super().settings(), ports={})

    async def reset(self):
        """Without servos, because the held motion might go on."""
        await until(lambda: self.site.controller.activity == STATE.HOLDING)
        self.arm.switch_servos(False, time.monotonic())
        async with asyncio.timeout(30.0):
            while self.site.controller.HasField("stop"):
                await self.site.lease(A.RENEW)
                with contextlib.suppress(RefusedError):
                    await self.site.command(C.RESET, stop_id=self.site.controller.stop.id)
                await asyncio.sleep(0.05)
        await until(lambda: self.site.controller.activity == STATE.STOPPED)
        self.arm.switch_servos(True, time.monotonic())
        await until(lambda: self.site.controller.activity == STATE.IDLE)

    def moves(self):
        return self.arm.moves(time.monotonic())

    def words(self):
        found = []
        for each in [*self.wires[""].sent, *self.wires["stop"].sent]:
            command, value = int.from_bytes(each[24:26], "little"), each[32:36]
            if command == 0x8B:
                found.append("move")
            elif command == 0x83 and each[29] == 0x10:
                found.append({b"\1\0\0\0": "stop", b"\2\0\0\0": "end of hold"}[value])
        return found

    def keep_back(self):
        self.wires[""].keep_back(lambda data: data[24] == 0x8B)
        return self.wires[""].release

    @staticmethod
    def corrupted(data):
        # Pulses of eight axes, after the type, form, tool and two frames.
        return data[:55] + b"\x40" + data[56:] if len(data) == 84 and data[32:36] == bytes(4) else data

    async def lose_reply(self):
        # The network loses the answer to the motion; its command is none of the answer's bytes.
        self.wires[""].answers = lambda data: [] if data[24] == 0x82 else [data]

    def go_local(self):
        self.arm.mode = Status1.PLAY

    def go_remote(self):
        self.arm.mode = Status1.PLAY | Status1.REMOTE

    async def start_foreign(self):
        self.arm.start(time.monotonic())

    def foreign_runs(self):
        return self.arm._program.runs

    async def end_foreign(self):
        self.settle(self.server)

    async def stop_elsewhere(self):
        self.arm.hold(True, time.monotonic())

    def change_tool(self):
        self.arm.tool = 5
        return lambda: setattr(self.arm, "tool", 0)

    def cut_stop(self):
        self.wires["stop"].swallows = True

    async def mend_stop(self):
        self.wires["stop"].swallows = False


async def rmi_paused(arm):
    arm.arm.pause_rmi(time.monotonic(), fault=False)


async def told_of_a_fault(arm):
    arm.server.session.send("Communication", "FRC_SystemFault", SequenceID=1)


async def refused(arm):
    arm.server.session.send("Instruction", "FRC_JointMotionJRep", ErrorID=2556964, SequenceID=1)


class RmiMover(Mover):
    name = "rmi"
    robot: ClassVar[dict] = {**fanuc_site.FANUC, "options": fanuc_site.MOVES}
    ports = ("rmi", "rmi_session")
    stops = local_stops = OURS
    dies_with_link = False
    allowed = frozenset({"connect", "initialize", "move", "stop", "disconnect"})
    causes: ClassVar[dict] = {
        each: f"fanuc.{code}"
        for each, code in {
            "tool": "tool_changed",
            "stop channel": "connection_lost",
            "late": "no_answer",
            "reply": "no_answer",
            "stop of others": "lost_program",
        }.items()
    }
    seat = "already connected"
    hazards: ClassVar[dict] = {
        "paused": (rmi_paused, lambda arm: None, "fanuc.arm_stopped"),
        "system fault": (told_of_a_fault, lambda arm: None, "fanuc.system_fault"),
        "refused": (refused, lambda arm: None, "fanuc.refused"),
    }
    impossible: ClassVar[dict] = {"datagrams": "TCP neither doubles nor reorders"}

    @staticmethod
    def controller(monkeypatch):
        monkeypatch.setattr("controllers.fanuc.rmi.motion_driver.SILENT_S", 1.0)
        monkeypatch.setattr("controllers.fanuc.rmi.motion_driver.ANSWER_S", 2.0)
        return fanuc_site.controller(monkeypatch)

    def moves(self):
        now_s = time.monotonic()
        return (self.arm._program if self.arm.rmi is None else self.arm.rmi).moving(now_s)

    def words(self):
        names = {"FRC_JointMotionJRep": "move", "FRC_Abort": "stop"}
        found = []
        for relay in ("rmi", "rmi_session"):
            for line in self.wires[relay].data.split(b"\r\n"):
                name = next(iter(json.loads(line).values())) if line else ""
                found += [names.get(name, name.removeprefix("FRC_").lower())] if name else []
        return found

    def keep_back(self):
        self.wires["rmi_session"].keep_back(lambda data: b"FRC_JointMotionJRep" in data)
        return self.wires["rmi_session"].release

    @staticmethod
    def corrupted(data):
        # The block of the position; axes follow the Cartesian position of 52 bytes.
        is_position = data[4:6] == b"\x68\0" and data[31:32] == b"\x94"
        return data[:110] + b"\x0f\x4a" + data[112:] if is_position else data

    async def lose_reply(self):
        await until(lambda: self.server.session)
        send = self.server.session.send
        lost = "FRC_JointMotionJRep"
        self.server.session.send = lambda kind, name, **values: name == lost or send(kind, name, **values)

    def go_local(self):
        self.arm.pendant_enabled = True
        self.arm.pause_rmi(time.monotonic(), fault=True)

    def go_remote(self):
        self.arm.pendant_enabled = False

    async def start_foreign(self):
        self.arm.start_program(fanuc_site.tour(self.server), time.monotonic())

    def foreign_runs(self):
        return self.arm.program_runs

    async def end_foreign(self):
        self.arm.end_program(time.monotonic())

    async def stop_elsewhere(self):
        self.arm.rmi.abort(time.monotonic())

    async def slow_down(self):
        self.arm.set_override(50, time.monotonic())

    def change_tool(self):
        self.arm.tool_number = 2
        return lambda: setattr(self.arm, "tool_number", 1)

    def fault(self, name):
        self.server.snpx._faults.begin(name, time.monotonic())

    def end_fault(self, name):
        self.server.snpx._faults.end(name)

    def cut_stop(self):
        self.wires["rmi_session"].cut()

    async def mend_stop(self):
        await self.wires["rmi_session"].open()

    @staticmethod
    def take_seat(server):
        server._granted_s = math.inf

    def free_seat(self):
        self.server._granted_s = -math.inf


MOVERS = (UnitMover, UrMover, HsesMover, RmiMover)


def every_mover(scenario):
    """Parametrize a test by all drivers that move; skip those whose protocol does not have the scenario."""
    return pytest.mark.parametrize(
        "mover",
        [
            pytest.param(
                each,
                id=each.name,
                marks=[pytest.mark.skip(reason=f"{each.name}: {each.impossible[scenario]}")]
                if scenario in each.impossible
                else [],
            )
            for each in MOVERS
        ],
    )
