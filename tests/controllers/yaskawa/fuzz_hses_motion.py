"""Broken answers of Yaskawa's controllers by HSES, to the driver that moves the arm.

    python -m tests.controllers.yaskawa.fuzz_hses_motion [--inputs N] [--seconds S] [--seed N] [--keep FOLDER]

A simulated network changes, doubles, delays, reorders and loses the answers on three sockets, which also
close. The controller is held, faulted and switched to local control at random, and motions, stops and resets
are commanded at random. A strict reading, which is independent of the gateway's, says when a motion or the
end of HOLD may be sent, and when a motion may end. Anything else that is sent, missing or reported ends the
run with exit status 1 and the datagram in the folder.
"""

import heapq
import math
import random
import struct
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from controllers.yaskawa.axes import YaskawaSettings
from controllers.yaskawa.driver import HSES
from controllers.yaskawa.motion_driver import MOTION, STOP, HsesMotionDriver
from protocol_gateway.driver_parts.pendant_text import text
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
    Refused,
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
from tests.controllers.yaskawa.fuzz_hses import (
    BUSY,
    DATA,
    READS,
    TIMEOUT_S,
    TOKENS,
    answer_datagram,
    strict_answer,
    strict_joints,
)
from tests.fuzz.fuzzing import Finding, Wrong, campaign, changed, near, step

NEW_BENCH_EACH = 5000
SETTINGS = YaskawaSettings(pulses_per_degree=(1000.0,) * 6, motion=True)
DECLARED = {
    "hses": {
        *((each, 1) for each in READS if each != 0x89),
        *((0x70, 2), (0x70, 3), (0x70, 4), (0x74, 11), (0x75, 101), (0x78, 1001), (0x89, 11)),
    },
    "stop": {(0x72, 1), (0x74, 11)},
    "motion": set(),
}
RUNNING, REMOTE, LOCAL = 0x08, 0x80, 0x60
HELD, HELD_BY_COMMAND, STOPPED, SERVO_ON = 0x0E, 0x08, 0x30, 0x40
FRESH_S, STILL_S, START_S, BLIND_S, OTHERS_S, ENDED_S = 0.6, 0.5, 1.0, 1.0, 1.0, 0.5
# A motion that nothing is seen of is given up by then: the socket of the stop is silent.
LATEST_S = 2.7
# After HOLD was sent, or was not needed, it is sent again within this time, timers being late.
REPEATED_S, REFUSED_S = 0.4, 1.2


def fuzz(inputs: int, seed: int, counts: Counter[str]) -> tuple[int, Finding | None]:
    """Return how many datagrams were read, and the first that was handled wrongly."""
    return step(partial(Bench, counts), inputs, seed, new_each=NEW_BENCH_EACH)


class Controller:
    """Controller of Yaskawa's kind that does what it is asked for, and is disturbed at random."""

    def __init__(self, chance: random.Random) -> None:
        self._chance = chance
        self._pulses = [0.0] * 6
        self._target: Sequence[int] | None = None
        self._at_s = 0.0
        self._held_by_command = False
        self.heal()

    def heal(self, second: int = SERVO_ON) -> None:
        self._first, self._second, self._tool, self._job = REMOTE | 4, second, 0, False

    def disturb(self) -> None:
        """Let one thing happen that ends, or forbids, a motion."""
        match self._chance.randrange(8):
            case 0:
                self._first = self._chance.choice((0x40, 0x20, 0))
            case 1:
                self._second &= ~SERVO_ON
            case 2:
                self._second |= self._chance.choice((0x10, 0x20))
            case 3:
                self._second |= self._chance.choice((2, 4))
            case 4:
                self._job = True
            case 5:
                self._tool += 1
            case 6:
                self._target = None
            case 7:
                self._held_by_command = not self._held_by_command

    def _status(self) -> tuple[int, int]:
        held = self._second | (HELD_BY_COMMAND if self._held_by_command else 0)
        return self._first | (RUNNING if self._job or (self._target and not held & HELD) else 0), held

    def _go_on(self, now_s: float) -> None:
        most, self._at_s = 20_000.0 * (now_s - self._at_s), now_s
        _, second = self._status()
        if self._target is None or second & (HELD | STOPPED) or not second & SERVO_ON:
            return
        for axis, target in enumerate(self._target):
            self._pulses[axis] += max(-most, min(most, target - self._pulses[axis]))
        if [*self._target] == self._pulses:
            self._target = None

    def answer(self, question: bytes, now_s: float) -> bytes:
        """Return the answer to a datagram."""
        self._go_on(now_s)
        number, command, service, chance = question[11], question[24], question[29], self._chance
        first, second = self._status()
        refuse = partial(answer_datagram, number, service, b"", status=0x1F)
        if chance.random() < 0.03:
            return refuse(added=chance.choice((*BUSY, 0xB008, 0x2010)))
        if command == 0x83:
            if not first & REMOTE:
                return refuse(added=0x2080)
            self._held_by_command = question[32] == 1
            return answer_datagram(number, service, b"")
        if command == 0x8B:
            if second & (HELD | STOPPED) or not second & SERVO_ON or not first & REMOTE or first & RUNNING:
                return refuse(added=0x2010)
            if chance.random() < 0.97:
                self._target = struct.unpack_from("<6i", question, 48)
            return answer_datagram(number, service, b"")
        if command == 0x72:
            return answer_datagram(number, service, struct.pack("<2I", first, second))
        if command == 0x75 and question[26] == 1:
            axes = [round(each) for each in self._pulses]
            return answer_datagram(number, service, struct.pack("<5I8i", 0, 0, self._tool, 0, 0, *axes, 0, 0))
        if command == 0x74 and question[26] > 10:
            return answer_datagram(number, service, b"", status=0x28)
        if command == 0x74:
            return answer_datagram(
                number, service, b"".join(bytes((each, 0, 0, 0)) for each in b"SLURBT\0\0")
            )
        return answer_datagram(number, service, chance.choice(DATA[command]))


@dataclass
class Sent:
    """A motion in hand, and what a strict reading says of it."""

    number: int
    sent_s: float
    start: Sequence[float]
    target: Sequence[float]
    tool: int
    accepted: bool = False
    refused_s: float = math.inf
    begun: bool = False
    arrived_s: float = math.inf
    quiet_s: float = math.inf


class Bench:
    """Driver with clock, network and controller, and the strict model of what it may do."""

    def __init__(self, counts: Counter[str], chance: random.Random) -> None:
        self.driver = HsesMotionDriver((JointType.ROTARY,) * 6, {}, options=SETTINGS)
        self.now_s = 100.0
        self._chance, self._counts = chance, counts
        self._controller = Controller(chance)
        # What happens next: datagrams, and sockets that open, without data.
        self._coming: list[tuple[float, int, Channel, bytes | None]] = []
        self._places = 0
        self._act_s = self.now_s
        self._unasked = UnaskedSends(self.driver.requests_a_second)
        self._begin()

    def _begin(self) -> None:
        self._coming, self._timers = [], Timers()
        self.opened: set[str] = set()
        self._questions: dict[str, tuple[bytes, float]] = {}
        self._status: tuple[int, int, float] | None = None
        self._answered_s = self._place_s = self._hold_s = self._release_s = -math.inf
        self._hold_refused_s = self._not_needed_s = -math.inf
        self._place: Sequence[float] = ()
        self._still: tuple[Sequence[float], float] = ((), 0.0)
        self._tool, self._percent = 0, 25.0
        self._names: Sequence[bytes] = ()
        self._base: bool | None = None
        self._motion: Sent | None = None
        self._wants_hold, self._unfinished, self._rests = False, True, True
        self._software, self._same = "", True
        self._perform(self.driver.started(self.now_s))

    # --------------------------------------------------------------- network and clock

    def _later(self, at_s: float, channel: Channel, data: bytes | None) -> None:
        self._places += 1
        heapq.heappush(self._coming, (at_s, self._places, channel, data))

    def _cut_off(self, channel: Channel) -> None:
        """Forget what is on its way to a socket; another one has another port."""
        self.opened.discard(channel.name)
        self._questions.pop(channel.name, None)
        self._coming = [each for each in self._coming if each[2] is not channel]
        heapq.heapify(self._coming)
        if channel is HSES:
            self._place, self._still, self._percent = (), ((), 0.0), 25.0
        if channel is STOP:
            self._status = None

    def _carry(self, channel: Channel, question: bytes) -> None:
        """Carry a datagram to the controller, and its answer back, once, twice or not at all."""
        if channel.name not in self.opened:
            return
        for _ in range(self._chance.choices((0, 1, 2), (4, 93, 3))[0]):
            answer = self._controller.answer(question, self.now_s)
            delay_s = self._chance.choice((0.002, 0.004, 0.02)) * (1.0 + self._chance.random())
            if self._chance.random() < 0.03:
                delay_s = self._chance.random()
            data = answer
            if self._chance.random() < 0.15:
                data = changed(answer, (answer, *DATA[0x75], *DATA[0x72]), TOKENS, self._chance)
            self._later(self.now_s + delay_s, channel, data)

    def next_input(self) -> tuple[Channel, bytes]:
        """Let time pass until a datagram arrives; return it with its channel."""
        while True:
            coming_s = self._coming[0][0] if self._coming else math.inf
            timer_s = min(self._timers.values(), default=math.inf)
            self.now_s = max(self.now_s + 1e-6, min(coming_s, timer_s, self._act_s))
            if timer_s <= self.now_s:
                late = self._chance.random() < 0.05
                self.now_s += 0.1 * self._chance.random() if late else 0.0
                self._perform(self.driver.timer_ended(self._timers.take(self.now_s), self.now_s))
                self._check_hold()
            elif coming_s <= self.now_s:
                _, _, channel, data = heapq.heappop(self._coming)
                if data is not None:
                    return channel, data
                self.opened.add(channel.name)
                if channel is HSES:
                    self._same = not self._software
                    self._names = ()
                if channel is STOP:
                    self._answered_s, self._base = self.now_s, None
                self._perform(self.driver.opened(channel, self.now_s))
            else:
                self._act_s = self.now_s + self._chance.expovariate(12.0)
                self._act()

    def _act(self) -> None:
        """Command something, disturb the controller, or close a socket."""
        chance = self._chance.random()
        if self._wants_hold and chance < 0.6:
            # Servos off, then RESET.
            if chance < 0.3:
                self.command(Reset())
            else:
                self._controller.heal(self._chance.choice((0, SERVO_ON)))
        elif chance < 0.6:
            here = self._place or (0.0,) * 6
            step = self._chance.choice((0, 100, 4000, 20_000))
            near = [round(math.degrees(each) * 1000) + self._chance.randint(-step, step) for each in here]
            pulses = [max(1 - 2**31, min(2**31 - 1, each)) for each in near]
            move = MoveAbsolute(tuple(math.radians(each / 1000) for each in pulses))
            first = self._chance.choices(((), (Speed(self._chance.uniform(1, 100)),), (Reset(),)), (6, 2, 1))[
                0
            ]
            self.command(*first, move, pulses=pulses)
        elif chance < 0.66:
            self.command(Stop())
        elif chance < 0.8:
            self.command(Reset())
        elif chance < 0.88:
            self._controller.disturb()
        elif chance < 0.98:
            self._controller.heal()
        elif chance < 0.982:
            self._percent = 25.0
            self._perform(self.driver.controlled(True, self.now_s))
        elif chance < 0.998:
            channel = self._chance.choice((HSES, STOP, MOTION))
            if channel.name in self.opened:
                self._cut_off(channel)
                self._later(self.now_s + self._chance.random() / 2, channel, None)
                self._perform(self.driver.closed(channel, self.now_s), closed=channel)
        else:
            self._begin()

    def command(self, *commands: ControllerCommand, pulses: Sequence[int] = ()) -> None:
        """Command, as the gateway does; a refusal changes nothing."""
        self.now_s += 1e-6
        allowed = self._may_move()
        kinds = [type(each) for each in commands]
        try:
            effects = self.driver.command(self.driver.prepare(*commands), self.now_s)
        except NotReadyError as error:
            if Stop in kinds or (MoveAbsolute in kinds and Reset not in kinds and allowed):
                raise Wrong(f"refuses {commands}: {error}") from None
            self._counts["refused"] += 1
            return
        self._counts.update(each.__name__ for each in kinds)
        percent = next((each.percent for each in commands if isinstance(each, Speed)), self._percent)
        sends = [each for each in effects if isinstance(each, Send)]
        if Stop in kinds:
            self._begin_hold()
            self._require_hold(effects)
            if not all(each.alternative for each in sends):
                raise Wrong(f"sends a stop that ends at its first failure: {sends}")
        if Reset in kinds:
            off = any(_is_hold(each.data, on=False) for each in sends)
            first, second, asked_s = self._status or (0, 0, -math.inf)
            held = second & HELD_BY_COMMAND and asked_s >= self._hold_s and self.now_s - asked_s < FRESH_S
            if off and (not held or (self._unfinished and second & SERVO_ON)):
                raise Wrong(f"ends HOLD at {first:02x} {second:02x}, unfinished {self._unfinished}")
            self._wants_hold = False
            self._release_s = self.now_s if off else self._release_s
            allowed = self._may_move()
        if MoveAbsolute in kinds:
            right = self._strict_motion(sends[-1].data[11], percent, pulses) if sends else b""
            if not allowed or [each.data for each in sends if each.channel is MOTION] != [right]:
                raise Wrong(f"moves by {sends}, at {self._status}; allowed: {allowed}")
            target = [math.radians(each / 1000) for each in pulses]
            self._motion = Sent(right[11], self.now_s, self._place, target, self._tool)
            self._unfinished = True
        self._percent = percent
        self._perform(effects, commanded=kinds)

    def receive(self, channel: Channel, data: bytes) -> None:
        """Give a datagram to the driver; compare what follows with a strict reading."""
        self.now_s += 1e-6
        asked, asked_s = self._questions.get(channel.name, (b"", -math.inf))
        answer = strict_answer(data, asked) if asked and self.now_s < asked_s + TIMEOUT_S else None
        joints: list[list[float]] = []
        status = None
        if answer is not None:
            del self._questions[channel.name]
            command, instance = asked[24], asked[26]
            if command == 0x72 and len(answer) == 8:
                status = struct.unpack("<2I", answer)
            if channel is HSES:
                joints = self._read(command, instance, answer)
            elif command == 0x74:
                self._read_base(data, answer)
        if channel is STOP and status is not None:
            self._status, self._answered_s = (*status, asked_s), self.now_s
        if channel is MOTION:
            self._read_answer(data)
        if channel is STOP and len(data) > 25 and data[24] == 0x90 and data[25]:
            self._hold_refused_s = self.now_s
        reported = status if channel is HSES else None
        seen_s = asked_s if channel is STOP and status is not None else -math.inf
        self._perform(self.driver.received(channel, data, self.now_s), joints, reported, seen_s)
        self._check_hold()

    # ---------------------------------------------------- a strict reading, written apart

    def _read(self, command: int, instance: int, answer: bytes) -> list[list[float]]:
        """Read an answer of the socket that reads; return the joints of it."""
        if command == 0x89 and len(answer) == 48:
            # By its texts: other bytes of the same text are not another controller.
            software = f"{text(answer[:24]) or 'unknown'}, {text(answer[24:40])}"
            if self._software not in ("", software):
                self._wants_hold = False
            self._software, self._same = software, True
        if command == 0x74 and instance == 1 and len(answer) in (24, 28, 32):
            self._names = [answer[at : at + 4].strip(b"\0 ") for at in range(0, len(answer), 4)]
        joints = strict_joints(answer) if command == 0x75 and instance == 1 else None
        if joints is None or (self._names and not all(self._names[:6])):
            return []
        self._place, self._place_s = joints, self.now_s
        self._tool = int.from_bytes(answer[8:12], "little")
        self._others = any(answer[44:])
        if not self._still[0] or not near(joints, self._still[0], 1e-3):
            self._still = joints, self.now_s
        return [joints]

    def _read_base(self, data: bytes, answer: bytes) -> None:
        added = int.from_bytes(data[28 : 28 + 2 * data[26]], "little")
        if added in BUSY:
            return
        self._base = bool(answer.strip(b"\0 "))
        if data[25]:
            self._base = False if data[25] == 0x28 or added in (0xA001, 0xB008) else None
        elif len(answer) not in (24, 28, 32):
            self._base = None

    def _read_answer(self, data: bytes) -> None:
        motion = self._motion
        question = bytes(11) + bytes((0 if motion is None else motion.number,)) + bytes(17) + b"\2"
        if motion is None or motion.accepted or strict_answer(data, question) is None:
            return
        if data[25]:
            motion.refused_s = self.now_s
        else:
            motion.accepted = True

    def _may_move(self) -> bool:
        """Return whether a motion may be sent now."""
        if self._status is None or not self._place or self.opened != {"hses", "stop", "motion"}:
            return False
        first, second, asked_s = self._status
        fresh = self.now_s - asked_s < FRESH_S and self.now_s - self._place_s <= FRESH_S
        axes = self._base is False and self._names and not any(self._names[6:]) and not self._others
        axes = axes and self._tool < 64
        at_rest = not first & RUNNING and self._motion is None and not self._wants_hold
        ready = first & REMOTE and second & SERVO_ON and not second & (HELD | STOPPED)
        return bool(fresh and axes and at_rest and ready)

    def _strict_motion(self, number: int, percent: float, pulses: Sequence[int]) -> bytes:
        head = b"YERC\x20\0\x58\0\3\1\0" + bytes((number, 0, 0, 0, 0)) + b"99999999\x8b\0\1\0\1\2\0\0"
        return head + struct.pack("<22i", 1, 0, 0, round(percent * 100), *pulses, 0, 0, self._tool, *[0] * 9)

    def _perform(
        self,
        effects: Effects,
        joints: Sequence[Sequence[float]] = (),
        status: tuple[int, int] | None = None,
        asked_s: float = -math.inf,
        *,
        commanded: Sequence[type] = (),
        closed: Channel | None = None,
    ) -> None:
        """Perform effects in their order, as the link does; compare them with the strict reading.

        Args:
            joints, status: What the datagram reports.
            asked_s: When a status of the socket for the stop was asked for, that the datagram answers.
            commanded: Commands whose effects they are.
            closed: Channel that has closed.
        """
        events = [event for each in effects if isinstance(each, Report) for event in each.events]
        self._counts.update(type(event).__name__ for event in events)
        found = [each.positions for each in events if isinstance(each, JointsReceived)]
        if len(found) != len(joints) or not all(map(partial(near, within=1e-9), found, joints)):
            raise Wrong(f"joints {found}, a strict reading gives {joints}")
        lost = [closed] if closed else [each.channel for each in effects if isinstance(each, Close)]
        fates = [each.why.code for each in effects if isinstance(each, FateUnknown)]
        self._follow(fates, asked_s, lost, refused=any(isinstance(each, Refused) for each in events))
        self._check_status([each for each in events if isinstance(each, StatusReceived)], status)
        if fates:
            self._begin_hold(fate=True)
            self._require_hold(effects)
        now_s = self.now_s
        for effect in effects:
            # As the link does: a stop in the same effects may set the same timers.
            if isinstance(effect, SetTimer):
                self._timers.set(effect)
        for effect in effects:
            match effect:
                case Send(channel, data):
                    self._check_sent(channel, data, commanded, now_s)
                    if not (commanded or fates or self._unasked.allowed(now_s)):
                        raise Wrong("sends more than it declares, so the link drops it")
                    self._carry(channel, data)
                case Open(channel):
                    self._cut_off(channel)
                    self._later(self.now_s + 0.1 * self._chance.random(), channel, None)
                case Close(channel):
                    self._cut_off(channel)
                case FateUnknown(why):
                    self._counts[why.code] += 1
                    # As the gateway does, while it performs the effects.
                    self.command(Stop())
                case _:
                    pass

    def _check_sent(self, channel: Channel, data: bytes, commanded: Sequence[type], now_s: float) -> None:
        command, instance, _, service = struct.unpack_from("<HHBB", data, 24)
        if _is_hold(data, on=True) and channel is not MOTION and self._wants_hold:
            self._hold_s = self._not_needed_s = now_s
        elif (_is_hold(data, on=False) and channel is STOP and Reset in commanded) or (
            command == 0x8B and channel is MOTION and MoveAbsolute in commanded
        ):
            # Compared already, where it was commanded.
            pass
        elif (
            (command, instance) not in DECLARED[channel.name] or service != READS[command] or len(data) != 32
        ):
            raise Wrong(f"sends {data!r} on {channel.name}, commanded: {commanded}")
        else:
            if now_s < self._questions.get(channel.name, (b"", -math.inf))[1] + TIMEOUT_S:
                raise Wrong(f"asks on {channel.name} before the answer")
            self._questions[channel.name] = data, now_s

    def _follow(
        self, fates: Sequence[str], asked_s: float, lost: Sequence[Channel], *, refused: bool
    ) -> None:
        """Compare the end of a motion, and a motion that goes on, with the strict reading."""
        motion = self._motion
        first, second, _ = self._status or (0, 0, 0.0)
        running, servo = first & RUNNING, second & SERVO_ON
        if motion is None:
            if fates or refused:
                raise Wrong(f"gives a motion up without one in hand: {fates}")
            if asked_s > max(self._hold_s, self._release_s) and not running and not second & HELD:
                self._unfinished = self._unfinished and self._wants_hold
            return
        known = self._place_s > motion.sent_s and len(self._place) == 6
        moved = known and not near(self._place, motion.start, 2e-3)
        there = known and near(self._place, motion.target, 2e-3)
        after = asked_s >= motion.sent_s
        pending = motion.refused_s < math.inf and not (motion.accepted or motion.begun or moved or running)
        judged = after and not pending
        waits = after and pending and min(asked_s, self._place_s) <= motion.refused_s
        motion.begun = motion.begun or (judged and bool(running or moved))
        if judged:
            motion.arrived_s = min(motion.arrived_s, self.now_s) if there else math.inf
            motion.quiet_s = math.inf if running else min(motion.quiet_s, self.now_s)
        ends = there and not running and (motion.accepted or motion.begun)
        quiet = judged and not running and not ends
        reasons = {
            "hses.channel_lost": bool(lost),
            "hses.arm_stopped": judged and bool(second & STOPPED or not servo),
            "hses.held": judged and bool(second & HELD),
            "hses.went_local": judged and not first & REMOTE,
            "hses.state_old": (judged or waits) and self.now_s - self._place_s > BLIND_S,
            "hses.tool_changed": judged and bool(self._place) and self._tool != motion.tool,
            "hses.other_job": judged and running and self.now_s - motion.arrived_s > OTHERS_S,
            "hses.ended_elsewhere": quiet and motion.begun and self.now_s - motion.quiet_s >= ENDED_S,
            "hses.not_started": quiet and not motion.begun and self.now_s - motion.sent_s >= START_S,
        }
        right = [code for code, applies in reasons.items() if applies]
        late = not motion.begun and self.now_s > motion.sent_s + LATEST_S
        if len(fates) != bool(right or late) or not {*fates} <= {*right}:
            raise Wrong(f"gives {motion} up for {fates}, a strict reading does for {right}: {self._status}")
        if self.driver._motion.sent is not None and not fates:
            return
        if refused:
            seen_s = min(asked_s, self._place_s)
            if not after or not pending or seen_s <= motion.refused_s:
                raise Wrong(f"takes {motion} as refused at {self._status}")
        elif not fates:
            if not judged or not ends:
                raise Wrong(f"ends {motion} at {self._status}, {self._place}")
            self._unfinished = False
            self._counts["arrived"] += 1
        self._motion = None

    def _check_status(self, found: Sequence[StatusReceived], status: tuple[int, int] | None) -> None:
        if len(found) != (status is not None):
            raise Wrong(f"states {found}, a strict reading gives {status}")
        if status is None:
            return
        right = Mode.REMOTE if status[0] & REMOTE else Mode.LOCAL if status[0] & LOCAL else None
        if found[0].mode is not right:
            raise Wrong(f"mode {found[0].mode} of {status}")
        activity = found[0].activity
        running = self._status is not None and self._status[0] & RUNNING
        if activity is Activity.IDLE and (running or self._motion is not None):
            raise Wrong("is idle while a motion runs")
        if self._rests or activity in (None, Activity.MOVING):
            return
        still = self._still[0] and self._place_s - self._still[1] >= STILL_S
        if not still or self.now_s - self._place_s >= FRESH_S:
            raise Wrong(f"{activity} after a stop, before the arm was seen at rest")
        self._rests = True

    def _begin_hold(self, *, fate: bool = False) -> None:
        """Note a stop, or that a motion was given up."""
        if self._motion is not None or fate:
            self._still = (), 0.0
        self._motion, self._wants_hold, self._rests = None, True, False
        self._not_needed_s = self.now_s
        self._hold_refused_s = -math.inf

    def _require_hold(self, effects: Effects) -> None:
        holds = [each.channel for each in effects if isinstance(each, Send) and _is_hold(each.data, on=True)]
        ends = [type(each) for each in effects if isinstance(each, FateUnknown) or holds]
        if holds != ([STOP, HSES] if "hses" in self.opened else [STOP]) or FateUnknown in ends[:1]:
            raise Wrong(f"HOLD is not sent: {effects}")

    def _check_hold(self) -> None:
        """Demand that HOLD is repeated until the controller shows it."""
        first, second, asked_s = self._status or (0, 0, -math.inf)
        fresh = asked_s >= self._hold_s and self.now_s - asked_s < FRESH_S
        shown = fresh and second & HELD_BY_COMMAND
        refused = self.now_s < self._hold_refused_s + REFUSED_S or (
            fresh and self._hold_refused_s > 0.0 and not first & REMOTE
        )
        if not self._wants_hold or not self._same or not self.opened & {"hses", "stop"} or shown or refused:
            self._not_needed_s = self.now_s
        elif self.now_s - self._not_needed_s > REPEATED_S:
            raise Wrong(f"does not repeat HOLD, at {self._status}")


def _is_hold(data: bytes, *, on: bool) -> bool:
    tail = b"\x83\0\1\0\1\x10\0\0" + bytes((1 if on else 2, 0, 0, 0))
    return data[:11] == b"YERC\x20\0\4\0\3\1\0" and data[12:24] == b"\0\0\0\x0099999999" and data[24:] == tail


if __name__ == "__main__":
    campaign(
        __doc__,
        fuzz,
        seconds=7200.0,
        name="yaskawa-motion",
        verdict="no exception, no joints, no motion, no end of a motion and no end of HOLD but what a strict "
        "reading gives; nothing but reads, motions and HOLD was sent",
    )
