"""Broken messages of Universal Robots' controllers, to the driver that moves the arm.

    python -m tests.controllers.universal_robots.fuzz_ur_motion [--inputs N] [--seconds S] [--seed N]
        [--keep FOLDER]

States by RTDE, lines of the dashboard and answers about inputs are changed at random, doubled, left out and
cut as TCP may; connections close. The controller is paused, stopped and switched to local control at random,
and motions, stops and recoveries are commanded at random. A strict reading, which is independent of the
gateway's, says when a program may be sent, how long its permission lasts, and when a motion may end. Anything
else that is sent, missing or reported ends the run with exit status 1 and the bytes in the folder.
"""

import heapq
import math
import random
import re
import struct
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from controllers.universal_robots.driver import PRIMARY, RTDE
from controllers.universal_robots.interfaces.state import OUTPUTS
from controllers.universal_robots.motion_driver import (
    DASHBOARD,
    INPUTS,
    SCRIPTS,
    RtdeMotionDriver,
)
from controllers.universal_robots.settings import MotionSettings, UniversalRobotsSettings
from protocol_gateway.link.link import UnaskedSends
from protocol_gateway.link.timers import Timers
from protocol_gateway.seam import (
    Activity,
    Channel,
    Close,
    ControllerCommand,
    Effects,
    FateUnknown,
    JointsReceived,
    Mode,
    MoveAbsolute,
    Open,
    Recover,
    RecoverAnswered,
    Recovery,
    Report,
    Reset,
    Send,
    SetTimer,
    Speed,
    StatusReceived,
    Stop,
)
from protocol_gateway.seam.errors import NotReadyError
from robots.kinematics.joints import JointType
from tests.controllers.universal_robots.fuzz_ur import PRIMARY as PRIMARY_MESSAGES
from tests.controllers.universal_robots.fuzz_ur import TOKENS, rtde_package, strict_packages
from tests.fuzz.fuzzing import Finding, Wrong, campaign, changed, cut, near, step

NEW_BENCH_EACH = 5000
SETTINGS = UniversalRobotsSettings(motion=MotionSettings())
CHANNELS = {each.name: each for each in (RTDE, PRIMARY, DASHBOARD, INPUTS, SCRIPTS)}
REGISTERS = tuple(f"output_int_register_{number}" for number in (24, 25, 26))
OFFERED = ("timestamp", "actual_q", "robot_mode", "safety_mode", "safety_status", "runtime_state")
TYPES = dict(OUTPUTS) | dict.fromkeys(REGISTERS, "INT32")
FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "UINT64": "Q",
    "INT32": "i",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
    "VECTOR6UINT32": "6I",
}
RECOVERIES = {
    Recovery.UNLOCK_PROTECTIVE_STOP: (b"unlock protective stop\n", b"Protective stop releasing"),
    Recovery.CLOSE_SAFETY_POPUP: (b"close safety popup\n", b"closing safety popup"),
    Recovery.RESTART_SAFETY: (b"restart safety\n", b"Restarting safety"),
    Recovery.POWER_ON: (b"power on\n", b"Powering on"),
    Recovery.BRAKE_RELEASE: (b"brake release\n", b"Brake releasing"),
}
QUESTION, STOP = b"is in remote control\n", b"stop\n"
BLANKS = (b"\xa0", b"\x85", b"\x1c", b"\x0c", b"\r", b" ", b"\t", b"\n", b"\0")
GREETING = (("V", b"\0\2"), ("V", b"\0\1"), ("v", b""), ("S", b""))
OF_INPUTS = (
    ("I", b"input_int_register_24,input_int_register_25"),
    ("O", struct.pack(">d", 1.0) + b"timestamp"),
)
STOPPED, PLAYING, WAITS = 1, 2, (3, 4, 5)
FRESH_S, REMOTE_S, START_S, BLIND_S, ENDED_S, STILL_S = 0.2, 1.5, 0.5, 0.3, 0.05, 0.5
# Timers end up to 0.1 s late; a state that is too old is excused once, a start too, by as much again.
LATE_S = 0.25


def fuzz(inputs: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many reads were given to the driver, and the first that was handled wrongly."""
    return step(partial(Bench, counts), inputs, seed, new_each=NEW_BENCH_EACH)


class Controller:
    """Controller that does what it is asked for, and is disturbed at random."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._joints, self._at_s = [0.0] * 6, 0.0
        self.registers = [0, 0, 0]
        self._inputs, self._heard_s = (0, 0), 0.0
        self._program: tuple[int, list[float], float] | None = None
        self.heal()

    def heal(self) -> None:
        self.remote, self._safety, self._robot, self._runtime = True, 1, 7, 0
        self._tool, self._version = 0.0, (5, 21, 0, 0)
        self._lacks: set[str] = set()

    def disturb(self) -> None:
        """Let one thing happen that ends, or forbids, a motion."""
        match self._chance.choice((0, 0, *range(9))):
            case 0:
                self.remote = False
            case 1:
                self._safety = self._chance.choice((2, 3, 3, 3, 4, 5, 8, 9))
            case 2:
                self._robot = self._chance.choice((3, 5, 6))
            case 3:
                self._runtime = self._chance.choice((2, 3, 4, 5, 6))
            case 4:
                self._tool += 0.1
            case 5:
                self.registers[self._chance.randrange(3)] = self._chance.randrange(5)
            case 6:
                self._program = None
            case 7:
                self._version = self._chance.choice(((5, 5, 0, 0), (3, 15, 0, 0), (10, 8, 0, 0)))
            case 8:
                self._lacks = {self._chance.choice((*REGISTERS, "runtime_state", "safety_status"))}

    def _go_on(self, now_s: float) -> None:
        most, self._at_s = 0.5 * (now_s - self._at_s), now_s
        if self._program is None:
            return
        number, target, begun_s = self._program
        if self._safety > 2 or self._robot != 7 or now_s - self._heard_s > max(0.3, begun_s + 0.3 - now_s):
            self._program = None
        elif self._inputs[0] == number:
            self._joints = [
                h + max(-most, min(most, t - h)) for h, t in zip(self._joints, target, strict=True)
            ]
            self.registers = [number, 2 if self._joints == target else 1, self._inputs[1]]
            self._program = None if self._joints == target else self._program
        elif self.registers[1] == 1 or now_s > begun_s + 0.2:
            self.registers[1] = 3 if self.registers[1] == 1 else 4
            self._program = None

    def script(self, data: bytes, now_s: float) -> None:
        """Begin a program."""
        if not self.remote or self._chance.random() < 0.03:
            return
        number = int(re.findall(rb"!= (\d+)", data)[0])
        target = [float(each) for each in re.findall(rb"\[(.*)\]", data)[0].split(b",")]
        self._program = number, target, now_s
        self.registers = [number, 4, self._inputs[1]]

    def written(self, data: bytes, now_s: float) -> None:
        """Take inputs."""
        self._inputs, self._heard_s = struct.unpack(">ii", data[4:]), now_s

    def stop(self) -> None:
        self._program = None

    def state(self, names: Sequence[str], now_s: float) -> bytes:
        """Return a data package with the fields of a recipe."""
        self._go_on(now_s)
        runtime = self._runtime or (STOPPED if self._program is None else PLAYING)
        numbers: dict[str, float] = dict(zip(REGISTERS, self.registers, strict=True))
        numbers |= {"timestamp": now_s, "robot_mode": self._robot, "runtime_state": runtime % 6}
        numbers |= {"safety_mode": self._safety, "safety_status": self._safety, "payload": 1.0}
        vectors = {"actual_q": self._joints, "tcp_offset": [self._tool] * 6}
        values = [each for name in names for each in vectors.get(name) or [numbers[name]]]
        return rtde_package(
            b"U", b"\1" + struct.pack(">" + "".join(FORMATS[TYPES[n]] for n in names), *values)
        )

    def types(self, names: Sequence[str]) -> bytes:
        """Return the answer to a set-up of outputs."""
        offered = {*OFFERED, *REGISTERS, "tcp_offset", "payload"} - self._lacks
        return ",".join(TYPES[each] if each in offered else "NOT_FOUND" for each in names).encode()

    @property
    def version(self) -> bytes:
        return struct.pack(">4I", *self._version)


@dataclass
class Sent:
    """A motion in hand, and what a strict reading says of it."""

    number: int
    sent_s: float
    tool: object
    begun: bool = False
    stopped_s: float = math.inf


class StrictRtde:
    """Strict reading of what a controller sends on one connection by RTDE, written apart.

    Attributes:
        failed: The connection has no further use.
        ready: States follow, or inputs may be written.
        version: Of the controller's software.
    """

    def __init__(self, *, writes: bool) -> None:
        self._writes = writes
        self._rest = b""
        self._requested, self._protocol = 2, 1
        self.version: tuple[int, ...] | None = None
        self.names: list[str] = []
        self._recipe = b""
        self._types: list[str] = []
        self.failed = self.ready = False

    def receive(self, data: bytes) -> list[dict[str, Any]]:
        """Return the states that the next bytes complete."""
        packages, rest = strict_packages(self._rest + data)
        states = []
        for kind, body in packages:
            if self.failed:
                break
            accepted = body == b"\1" if body in (b"\0", b"\1") else None
            state = (self._of_inputs if self._writes else self._of_outputs)(chr(kind), body, accepted)
            states += [] if state is None else [state]
        self.failed = self.failed or rest is None
        self._rest = rest or b""
        return states

    def _of_inputs(self, kind: str, body: bytes, accepted: bool | None) -> None:
        """Follow the set-up of two inputs: any other answer fails."""
        if kind in "UM":
            return
        if kind == "V" and accepted and self._protocol == 1:
            self._protocol = 2
        elif kind == "I" and body[1:] == b"INT32,INT32" and self._protocol == 2 and not self._types:
            self._types, self._recipe = ["INT32"] * 2, body[:1]
        elif (kind == "O" and body[1:] == b"DOUBLE" and self._types) or (
            kind == "S" and accepted and self._types
        ):
            self.ready = self.ready or kind == "S"
        else:
            self.failed, self.ready = True, False

    def _of_outputs(self, kind: str, body: bytes, accepted: bool | None) -> dict[str, Any] | None:
        if kind == "P" and accepted is not None:
            self.failed = True
        elif kind == "V" and accepted is not None and self.version is None:
            self.failed = not accepted and self._requested == 1
            self._protocol = self._requested if accepted else self._protocol
            self._requested = self._requested if accepted else 1
        elif kind == "v" and len(body) == 16 and self.version is None:
            self.version = struct.unpack(">4I", body)
        elif kind == "O" and self.version is not None and not self._types:
            self._set_up(body)
        elif kind == "S" and accepted is not None and self._types and not self.ready:
            self.ready, self.failed = accepted, not accepted
        elif kind == "U" and self.ready:
            return self._state(body)
        return None

    def _set_up(self, body: bytes) -> None:
        numbered = self._protocol > 1
        types = body[numbered:].decode("ascii", "replace").split(",")
        if (numbered and not body) or {*types} - {*FORMATS, "NOT_FOUND", "IN_USE"}:
            return
        found = dict(zip(self.names, types, strict=False))
        wrong = [name for name, kind in found.items() if kind not in ("NOT_FOUND", TYPES[name])]
        missing = [name for name, kind in found.items() if kind == "NOT_FOUND"]
        if len(types) != len(self.names) or wrong or {*missing} & {"timestamp", "actual_q"}:
            self.failed = True
        elif not missing:
            self._types, self._recipe = types, body[:numbered]

    def _state(self, body: bytes) -> dict[str, Any] | None:
        form = struct.Struct(">" + "".join(FORMATS[each] for each in self._types))
        begin = len(self._recipe)
        if body[:begin] != self._recipe or len(body) != begin + form.size:
            return None
        flat, state = list(form.unpack(body[begin:])), {}
        for name, kind in zip(self.names, self._types, strict=True):
            count = int(FORMATS[kind][:-1] or 1)
            values, flat = tuple(flat[:count]), flat[count:]
            if all(each - each == 0 for each in values):
                state[name] = values if count > 1 else values[0]
        return state if {"timestamp", "actual_q"} <= {*state} else None


class Bench:
    """Driver with clock, connections and controller, and the strict model of what it may do."""

    def __init__(self, counts: Counter[str], chance: random.Random) -> None:
        self.driver = RtdeMotionDriver((JointType.ROTARY,) * 6, {}, options=SETTINGS)
        self.driver._number = chance.randrange(2**30) + 1
        self.now_s = 100.0
        self._chance, self._counts = chance, counts
        self._controller = Controller(chance)
        self._places = 0
        self._act_s = self.now_s
        self._unasked = UnaskedSends(self.driver.requests_a_second)
        self._beat = 0
        self._waits: Recovery | None = None
        self._begin()

    def _begin(self) -> None:
        # What happens next: bytes, and connections that open, without data.
        self._coming: list[tuple[float, int, Channel, bytes | None]] = []
        self._last_s: Counter[str] = Counter()
        self._timers, self._state_s = Timers(), math.inf
        self._data_s = self.now_s
        self.opened: set[str] = set()
        self._scripts = False
        self._answered: list[tuple[Recovery, bool | None]] = []
        for channel in CHANNELS.values():
            self._forget(channel)
        self._motion: Sent | None = None
        self._percent, self._rests = 25.0, True
        self._written_s = -math.inf
        self._perform(self.driver.started(self.now_s))

    # ----------------------------------------------------------- connections and clock

    def _later(self, at_s: float, channel: Channel, data: bytes | None) -> None:
        self._places += 1
        # A connection delivers in order.
        at_s = self._last_s[channel.name] = max(at_s, self._last_s[channel.name] + 1e-6)
        heapq.heappush(self._coming, (at_s, self._places, channel, data))

    def _forget(self, channel: Channel) -> None:
        """Forget a connection, and what is on its way."""
        self.opened.discard(channel.name)
        self._coming = [each for each in self._coming if each[2] is not channel]
        heapq.heapify(self._coming)
        self._last_s[channel.name] = 0.0
        if channel is RTDE:
            self._rtde, self._state, self._percent = StrictRtde(writes=False), None, 25.0
            self._still: tuple[Sequence[float], float] | None = None
            self._protective_s = math.inf
        if channel is INPUTS:
            self._inputs = StrictRtde(writes=True)
        if channel is DASHBOARD:
            self._expected: deque[Any] = deque(["greeting"])
            self._line = b""
            self._was_local, self._asked = False, False
            if self._waits is not None:
                self._answered.append((self._waits, None))
            self._waits = None
            self._remote: bool | None = None
            self._remote_s = -math.inf

    def _deliver(self, channel: Channel, message: bytes) -> None:
        """Bring a message of the controller on its way, as TCP may, and seldom changed."""
        copies = self._chance.choices((0, 1, 2), (1, 198, 1))[0]
        data = b""
        for _ in range(copies):
            broken = self._chance.random() < (0.05 if channel in (DASHBOARD, PRIMARY) else 0.02)
            others = (message, b"true\n", b"false\n", b"Stopped\n") if channel is DASHBOARD else (message,)
            tokens = BLANKS if channel is DASHBOARD and self._chance.random() < 0.5 else TOKENS
            data += changed(message, others, tokens, self._chance) if broken else message
        at_s = self.now_s + 0.002 + (0.4 * self._chance.random() if self._chance.random() < 0.01 else 0.0)
        for piece in cut(data, self._chance) if self._chance.random() < 0.1 else [data]:
            at_s += 0.002 * self._chance.random()
            if piece:
                self._later(at_s, channel, piece)

    def _carry(self, channel: Channel, data: bytes) -> None:
        """Carry bytes to the controller, and its answers back."""
        controller, deliver = self._controller, partial(self._deliver, channel)
        if channel.name not in self.opened:
            return
        if channel is SCRIPTS:
            controller.script(data, self.now_s)
        for line in data.splitlines(keepends=True) if channel is DASHBOARD else ():
            if line == STOP:
                controller.stop()
            words = dict(RECOVERIES.values())
            remote = b"true" if controller.remote else b"false"
            right = remote if line == QUESTION else words.get(line, b"Stopped")
            wrong = self._chance.random() < 0.03 and line != QUESTION
            deliver((b"Command is not allowed" if wrong else right) + b"\n")
        for kind, body in strict_packages(data)[0] if channel in (RTDE, INPUTS) else ():
            match chr(kind):
                case "V":
                    deliver(rtde_package(b"V", bytes([self._chance.random() < 0.97])))
                case "v":
                    deliver(rtde_package(b"v", controller.version))
                case "O" if channel is RTDE:
                    self._names = body.rpartition(b"\0")[2].decode().split(",")
                    deliver(rtde_package(b"O", b"\1" + controller.types(self._names)))
                case "O":
                    deliver(rtde_package(b"O", b"\1DOUBLE"))
                case "I":
                    used = self._chance.random() < 0.03
                    deliver(rtde_package(b"I", b"\7INT32," + (b"IN_USE" if used else b"INT32")))
                case "S":
                    deliver(rtde_package(b"S", b"\1"))
                    self._data_s = self.now_s if channel is RTDE else self._data_s
                case "U":
                    controller.written(data, self.now_s)

    def next_input(self) -> tuple[Channel, bytes]:
        """Let time pass until bytes arrive; return them with their channel."""
        while True:
            coming_s = self._coming[0][0] if self._coming else math.inf
            timer_s = min(self._timers.values(), default=math.inf)
            now_s = self.now_s = max(self.now_s + 1e-6, min(coming_s, timer_s, self._act_s, self._data_s))
            if timer_s <= now_s:
                late = self._chance.random() < 0.03
                self.now_s += 0.1 * self._chance.random() if late else 0.0
                self._perform(self.driver.timer_ended(self._timers.take(self.now_s), self.now_s))
            elif coming_s <= now_s:
                _, _, channel, data = heapq.heappop(self._coming)
                if data is not None:
                    while self._joins(channel):
                        data += heapq.heappop(self._coming)[3] or b""
                    return channel, data
                self._open(channel)
            elif self._data_s <= now_s:
                self._data_s = now_s + 0.03 + (0.5 * (self._chance.random() < 0.01))
                if self._rtde.ready:
                    self._deliver(RTDE, self._controller.state(self._names, now_s))
                if "primary" in self.opened and self._chance.random() < 0.02:
                    self._deliver(PRIMARY, self._chance.choice(PRIMARY_MESSAGES))
            else:
                self._act_s = now_s + self._chance.expovariate(4.0)
                self._act()

    def _joins(self, channel: Channel) -> bool:
        """Return whether one read also gets what comes next."""
        coming = bool(self._coming) and self._coming[0][2] is channel and self._coming[0][3] is not None
        return coming and self._chance.random() < 0.1

    def _open(self, channel: Channel) -> None:
        if channel is SCRIPTS and not self._controller.remote:
            self._later(self.now_s + 0.5, channel, None)
            self._perform(self.driver.closed(channel, self.now_s))
            return
        self.opened.add(channel.name)
        if channel is DASHBOARD:
            self._deliver(DASHBOARD, b"Connected: Universal Robots Dashboard Server\n")
        self._perform(self.driver.opened(channel, self.now_s))

    def _close(self, channel: Channel, *, skipped: bool = False) -> None:
        """Close a connection, or let the gateway discard bytes of it; the link connects again."""
        if channel.name not in self.opened:
            return
        if skipped:
            effects = self.driver.skipped(channel, self.now_s)
            closes = [each.channel for each in effects if isinstance(each, Close)]
            if channel is not SCRIPTS and channel not in closes:
                raise Wrong(f"goes on with {channel.name} after bytes were discarded")
            self._perform(effects)
            return
        self._forget(channel)
        # The mode must be asked again: the controller closes it at a change to local control.
        self._remote = None if channel is SCRIPTS else self._remote
        self._later(self.now_s + 0.5 * self._chance.random(), channel, None)
        self._perform(self.driver.closed(channel, self.now_s), lost=[channel.name])

    def _act(self) -> None:
        """Command something, disturb the controller, or close a connection."""
        chance = self._chance.random()
        if chance < 0.55:
            here = (0.0,) * 6 if self._state is None else self._state["actual_q"]
            step = self._chance.choice((0.0, 0.01, 0.3))
            target = tuple(each + self._chance.uniform(-step, step) for each in here)
            if all(abs(each) < 100.0 for each in target):
                first = self._chance.choice(((), (), (Speed(self._chance.uniform(1, 100)),), (Reset(),)))
                self.command(*first, MoveAbsolute(target))
        elif chance < 0.62:
            self.command(Stop())
        elif chance < 0.72:
            self.command(Recover(self._chance.choice(list(RECOVERIES))))
        elif chance < 0.8:
            self._controller.disturb()
            if not self._controller.remote:
                self._close(SCRIPTS)
        elif chance < 0.97:
            self._controller.heal()
        elif chance < 0.975:
            self._percent = 25.0
            self._perform(self.driver.controlled(True, self.now_s))
        elif chance < 0.998:
            self._close(CHANNELS[self._chance.choice(list(CHANNELS))], skipped=self._chance.random() < 0.2)
        else:
            self._begin()

    def command(self, *commands: ControllerCommand) -> None:
        """Command, as the gateway does; a refusal changes nothing."""
        kinds = [type(each) for each in commands]
        allowed = self._may_move()
        recover = next((each.recovery for each in commands if isinstance(each, Recover)), None)
        recovers = recover is not None and self._may_recover(recover)
        may = (allowed or MoveAbsolute not in kinds) and (recovers or recover is None)
        try:
            effects = self.driver.command(self.driver.prepare(*commands), self.now_s)
        except NotReadyError as error:
            if may:
                raise Wrong(f"refuses {commands}: {error}") from None
            self._counts["refused"] += 1
            return
        if not may:
            raise Wrong(f"sends {effects} at {self._state}, remote: {self._remote}")
        self._counts.update(each.__name__ for each in kinds)
        sends = [(each.channel, each.data) for each in effects if isinstance(each, Send)]
        self._percent = next((each.percent for each in commands if isinstance(each, Speed)), self._percent)
        if Stop in kinds:
            self._end(moved=True)
            ways = [INPUTS] * self._inputs.ready
            ways += [DASHBOARD] if "dashboard" in self.opened or not ways else []
            if [each.channel for each in effects if isinstance(each, Send) and each.alternative] != ways:
                raise Wrong(f"a stop by {sends}")
            if INPUTS in ways and sends[0][1][4:8] != bytes(4):
                raise Wrong(f"a stop that leaves the permission: {sends}")
        if MoveAbsolute in kinds:
            (script,) = (data for channel, data in sends if channel is SCRIPTS)
            (permission,) = (data for channel, data in sends if channel is INPUTS)
            number = int.from_bytes(permission[4:8], "big")
            self._check_script(script, number, commands[-1].positions)  # type: ignore[union-attr]
            self._motion = Sent(number, self.now_s, self._tool())
        self._perform(effects, commanded=kinds, recovery=recover)

    def _check_script(self, script: bytes, number: int, target: Sequence[float]) -> None:
        """Demand a program that moves once, to the target, while it has its permission."""
        moves = re.findall(rb"movej\(\[(.*)\], a=(.*), v=(.*), t=0, r=0\)", script)
        numbers = re.findall(rb"(?:==|!=) (\d+)|register\(24, (\d+)\)", script)
        if (
            len(moves) != 1
            or script.count(b"move") != 3
            or b'"input_int_register_25", 10, "stop"' not in script
        ):
            raise Wrong(f"the program {script!r}")
        joints, *rates = ([float(each) for each in part.split(b",")] for part in moves[0])
        right = [*target, math.radians(80.0), math.radians(60.0) * self._percent / 100.0]
        if not near([*joints, *rates[0], *rates[1]], right, 1e-6) or number <= 0:
            raise Wrong(f"the program {script!r} for {target}")
        if {int(a or b) for a, b in numbers} != {number} or len(numbers) != 4:
            raise Wrong(f"the program {script!r} has other permissions than {number}")

    # ---------------------------------------------------- a strict reading, written apart

    def receive(self, channel: Channel, data: bytes) -> None:
        """Give bytes to the driver; compare what follows with a strict reading."""
        self.now_s += 1e-6
        states: list[dict[str, Any]] = []
        lost: list[str] = []
        went_local = False
        if channel is RTDE:
            states = self._rtde.receive(data)
            lost = ["rtde"] if self._rtde.failed else []
        if channel is INPUTS:
            self._inputs.receive(data)
            lost = ["inputs"] if self._inputs.failed else []
        if channel is DASHBOARD:
            lost = ["dashboard"] if self._read_lines(data) else []
            went_local = self._remote is False and not lost
        effects = self.driver.received(channel, data, self.now_s)
        closes = [each.channel.name for each in effects if isinstance(each, Close)]
        if lost and lost[0] not in closes:
            raise Wrong(f"goes on with {lost[0]}, which cannot be read")
        self._perform(effects, states=states, went_local=went_local)

    def _read_lines(self, data: bytes) -> bool:
        """Read lines of the dashboard; return whether which answers which is not known any longer."""
        lost = False
        *lines, self._line = (self._line + data).split(b"\n")
        for line in (each.strip(b" \t\r") for each in lines):
            expected = self._expected.popleft() if self._expected else None
            lost = lost or expected is None
            if expected == "mode":
                self._asked, self._remote_s = False, self.now_s
                self._remote = {b"true": True, b"false": False}.get(line.lower())
                self._was_local = self._was_local or self._remote is False
            if isinstance(expected, Recovery):
                begin = RECOVERIES[expected][1].lower()
                self._answered.append((expected, line.lower()[: len(begin)] == begin))
                self._waits = None
        return lost or len(self._line) > 1000

    def _tool(self) -> object:
        assert self._state is not None
        return tuple(self._state.get(name) for name in ("tcp_offset", "payload", "payload_cog"))

    def _may_move(self) -> bool:
        """Return whether a program may be sent now."""
        state, version = self._state, self._rtde.version
        if state is None or version is None or version[0] != 5 or version[1] < 6 or self._motion is not None:
            return False
        return (
            self.now_s - self._state_s <= FRESH_S
            and all(name in state for name in REGISTERS)
            and state.get("runtime_state") == STOPPED
            and _safety(state) in (1, 2)
            and state.get("robot_mode") == 7
            and self._remote is True
            and not self._was_local
            and self.now_s - self._remote_s <= REMOTE_S
            and self._inputs.ready
            and {"scripts", "dashboard", "inputs", "rtde"} <= self.opened
        )

    def _may_recover(self, recovery: Recovery) -> bool:
        state = self._state
        if state is None or self._motion is not None or self._waits is not None:
            return False
        safety, robot = _safety(state), state.get("robot_mode")
        fits = {
            Recovery.UNLOCK_PROTECTIVE_STOP: safety == 3 and self.now_s - self._protective_s >= 5.0,
            Recovery.CLOSE_SAFETY_POPUP: True,
            Recovery.RESTART_SAFETY: safety in (8, 9),
            Recovery.POWER_ON: safety in (1, 2) and robot == 3,
            Recovery.BRAKE_RELEASE: safety in (1, 2) and robot == 5,
        }
        return (
            self.now_s - self._state_s <= FRESH_S
            and state.get("runtime_state") == STOPPED
            and self._remote is True
            and not self._was_local
            and self.now_s - self._remote_s <= REMOTE_S
            and "dashboard" in self.opened
            and fits[recovery]
        )

    def _end(self, *, moved: bool) -> None:
        """Note the end of a motion; `moved`: the arm may still move."""
        if moved:
            self._rests = False
            if self._motion is not None:
                self._still = None
        self._motion = None

    def _follow(self, state: dict[str, Any]) -> tuple[str, ...]:
        """Follow the motion by a state; return why it must be given up, or that it has ended."""
        self._state, self._state_s = state, self.now_s
        self._protective_s = min(self._protective_s, self.now_s) if _safety(state) == 3 else math.inf
        motion = self._motion
        if motion is None:
            return ()
        number, progress, heard = (state.get(name) for name in REGISTERS)
        runtime = state.get("runtime_state")
        motion.begun = motion.begun or number == motion.number
        reasons = {
            "arm_stopped": _safety(state) not in (1, 2) or state.get("robot_mode") != 7,
            "paused": runtime in WAITS,
            "tool_changed": self._tool() != motion.tool,
            "lost_program": (number != motion.number and motion.begun)
            or (number == motion.number and runtime == PLAYING and (self._beat - (heard or 0)) % 2**30 > 13),
        }
        if found := tuple(reason for reason, applies in reasons.items() if applies):
            return found
        if number != motion.number or runtime not in (STOPPED, PLAYING):
            return ()
        motion.stopped_s = min(motion.stopped_s, self.now_s) if runtime == STOPPED else math.inf
        ended = runtime == STOPPED and (progress == 2 or self.now_s - motion.stopped_s >= ENDED_S)
        return ("ended",) if ended else ()

    def _perform(
        self,
        effects: Effects,
        *,
        states: Sequence[dict[str, Any]] = (),
        lost: Sequence[str] = (),
        went_local: bool = False,
        commanded: Sequence[type] = (),
        recovery: Recovery | None = None,
    ) -> None:
        """Perform effects in their order, as the link does; compare them with the strict reading.

        Args:
            states: States that the bytes complete.
            lost: Connection that has ended.
            went_local: The newest answer of the dashboard says so.
            commanded, recovery: Commands whose effects they are.
        """
        events = [event for each in effects if isinstance(each, Report) for event in each.events]
        self._counts.update(type(event).__name__ for event in events)
        joints = [each.positions for each in events if isinstance(each, JointsReceived)]
        if joints != [each["actual_q"] for each in states]:
            raise Wrong(f"joints {joints}, a strict reading gives {states}")
        lost = [*lost, *(each.channel.name for each in effects if isinstance(each, Close))]
        fates = [each.why.code.partition(".")[2] for each in effects if isinstance(each, FateUnknown)]
        self._judge(effects, events, states, fates, lost, went_local=went_local)
        for effect in effects:
            # A stop in the same effects must not use the closed connection.
            if isinstance(effect, Close):
                self._forget(effect.channel)
        now_s = self.now_s
        for effect in effects:
            # As the link does: a stop in the same effects may set the same timers.
            if isinstance(effect, SetTimer):
                self._timers.set(effect)
        for effect in effects:
            match effect:
                case Send(channel, data):
                    if not (commanded or fates or self._unasked.allowed(now_s)):
                        raise Wrong("sends more than it declares, so the link drops it")
                    self._check_sent(channel, data, commanded, recovery)
                    self._carry(channel, data)
                case Open(channel):
                    self._forget(channel)
                    self._later(now_s + 0.05 * self._chance.random(), channel, None)
                case FateUnknown(why):
                    self._counts[why.code] += 1
                    # As the gateway does, while it performs the effects.
                    self.command(Stop())
                case _:
                    pass
        found = [(each.recovery, each.accepted) for each in events if isinstance(each, RecoverAnswered)]
        if found != self._answered[: len(found)] or (not commanded and len(found) != len(self._answered)):
            raise Wrong(f"recoveries {found}, a strict reading gives {self._answered}")
        del self._answered[: len(found)]
        self._check_permission()

    def _judge(
        self,
        effects: Effects,
        events: Sequence[object],
        states: Sequence[dict[str, Any]],
        fates: Sequence[str],
        lost: Sequence[str],
        *,
        went_local: bool,
    ) -> None:
        """Compare the end of a motion, and a motion that goes on, with the strict reading."""
        statuses = [each for each in events if isinstance(each, StatusReceived)]
        if len(statuses) != len(states):
            raise Wrong(f"states {statuses}, a strict reading gives {states}")
        right: tuple[str, ...] = ()
        motion, had_s = self._motion, self._state_s
        for state, status in zip(states, statuses, strict=True):
            self._check_status(state, status)
            found = self._follow(state) if not right else ()
            if found:
                self._end(moved=found != ("ended",))
                right = found
            self._state, self._state_s = state, self.now_s
        if motion is None:
            if fates:
                raise Wrong(f"gives a motion up without one in hand: {fates}")
            return
        age_s = self.now_s - (self._state_s if states else had_s)
        due_s = self.now_s - motion.sent_s
        allowed = {*right} - {"ended"}
        allowed |= {"channel_lost"} if {*lost} & {"rtde", "inputs", "dashboard"} else set()
        allowed |= {"went_local"} if went_local else set()
        demanded = bool(allowed)
        allowed |= {"state_old"} if age_s > BLIND_S else set()
        allowed |= {"not_started"} if due_s > START_S - 1e-9 and not motion.begun else set()
        demanded = demanded or age_s > BLIND_S + LATE_S or (due_s > 2 * START_S + LATE_S and not motion.begun)
        if right != ("ended",) and (len(fates) > 1 or not {*fates} <= allowed or (demanded and not fates)):
            raise Wrong(
                f"gives {motion} up for {fates}, a strict reading does for {allowed} at {self._state}"
            )
        ended = right == ("ended",) and not fates
        if (self.driver._motion.sent is None) != bool(fates or ended):
            raise Wrong(f"{motion} has ended: {not ended}, {fates}, at {self._state}")
        if not fates and not ended:
            return
        self._counts["ended"] += ended
        self._end(moved=not ended)
        before = (
            [*effects][: [isinstance(each, FateUnknown) for each in effects].index(True)]
            if fates
            else effects
        )
        ends = [each.data[4:8] for each in before if isinstance(each, Send) and each.channel is INPUTS]
        writable = self._inputs.ready and "inputs" not in lost
        if writable and ends[-1:] != [bytes(4)]:
            raise Wrong(f"the permission of {motion} does not end: {effects}")

    def _check_status(self, state: dict[str, Any], status: StatusReceived) -> None:
        """Demand that a status shows no more than the state, and rest only if the arm was seen at rest."""
        joints = state["actual_q"]
        if self._still is None or not near(joints, self._still[0], 1e-3):
            self._still = joints, self.now_s
        known = self._remote is not None and self.now_s - self._remote_s <= REMOTE_S
        if status.mode is not ((Mode.REMOTE if self._remote else Mode.LOCAL) if known else None):
            raise Wrong(f"mode {status.mode}, remote: {self._remote}")
        idle = state.get("runtime_state") == STOPPED and state.get("robot_mode", 7) == 7
        idle = idle and _safety(state) in (None, 1, 2, 4)
        still = self._rests or self.now_s - self._still[1] >= STILL_S
        if status.activity is Activity.IDLE and not (idle and still):
            raise Wrong(f"is idle at {state}, still since {self._still}")
        self._rests = self._rests or (status.activity is not Activity.MOVING and still)

    def _check_sent(
        self, channel: Channel, data: bytes, commanded: Sequence[type], recovery: Recovery | None
    ) -> None:
        """Demand that bytes may be sent now on their channel."""
        name = channel.name
        if channel is DASHBOARD and data == QUESTION and not self._asked and not commanded:
            self._asked = True
            self._expected.append("mode")
        elif channel is DASHBOARD and data == STOP and Stop in commanded:
            if name in self.opened:
                self._expected.append("stop")
        elif channel is DASHBOARD and recovery is not None and data == RECOVERIES[recovery][0]:
            self._expected.append(recovery)
            self._waits = recovery
        elif channel is SCRIPTS and MoveAbsolute in commanded:
            pass
        elif channel is INPUTS and data[2:3] == b"U" and len(data) == 12 and self._inputs.ready:
            go, beat = struct.unpack(">ii", data[4:])
            if go not in (0, 0 if self._motion is None else self._motion.number) or (
                beat != (self._beat + 1) % 2**30 or data[3:4] != self._inputs._recipe
            ):
                raise Wrong(f"writes {go} and the beat {beat} for {self._motion}")
            self._beat, self._written_s = beat, self.now_s
        elif channel not in (RTDE, INPUTS) or commanded or not self._greets(channel, data):
            raise Wrong(f"sends {data!r} on {name}, commanded: {commanded}")

    def _greets(self, channel: Channel, data: bytes) -> bool:
        """Return whether bytes belong to the greeting of a connection."""
        packages, rest = strict_packages(data)
        for kind, body in packages:
            names = body.rpartition(b"\0")[2].decode("ascii").split(",")
            if chr(kind) == "O" and channel is RTDE and {*names} <= {*TYPES}:
                self._rtde.names = names
            elif (chr(kind), body) not in GREETING + OF_INPUTS * (channel is INPUTS):
                return False
        ready = self._rtde.ready if channel is RTDE else self._inputs.ready
        return rest == b"" and not ready

    def _check_permission(self) -> None:
        """Demand that the permission of a motion is repeated."""
        if self._motion is not None and self.now_s - max(self._written_s, self._motion.sent_s) > LATE_S:
            raise Wrong(f"does not repeat the permission of {self._motion}")


def _safety(state: dict[str, Any]) -> int | None:
    found: int | None = state.get("safety_status", state.get("safety_mode"))
    return found


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        seconds=7200.0,
        name="ur-motion",
        verdict="no exception, no joints, no program, no permission, no recovery and no end of a motion but "
        "what a strict reading gives; nothing else was sent",
    )
