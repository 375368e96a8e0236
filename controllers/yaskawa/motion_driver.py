"""Driver of Yaskawa controllers that also moves the robot.

    channel   carries   sent
    -------   -------   ------------------------------------------------------------------
    hses      reading   the questions of the driver that only reads; HOLD, as a second way
    stop      stop      HOLD; the question for the status, ten times a second
    motion    motion    the motions

The driver sends one motion at a time, to absolute pulses. Its stop is HOLD. Each channel is a socket of its
own, to the same port of the controller, so each numbers its own messages. UDP loses, doubles and delays them:

- The driver repeats a question. It repeats HOLD until the status shows it.
- The driver sends a motion once. Without an answer it looks for the motion in the status and the positions.
  If they do not show the motion, or show something else, the driver sets HOLD and the gateway latches a stop.
  A controller on HOLD refuses a motion that arrives late.
- The driver sends the end of HOLD once, at RESET. A held motion of the gateway may continue then. If there
  may be one, the driver ends HOLD only while the servos are off.
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from typing import Any

import numpy as np

from controllers.yaskawa import codes as hses_codes
from controllers.yaskawa import commands
from controllers.yaskawa import data as payloads
from controllers.yaskawa.axes import YaskawaSettings, instance_of
from controllers.yaskawa.data import HELD, Position, Status, Status1, Status2
from controllers.yaskawa.driver import HSES, STATUS, HsesDriver, mode_of
from controllers.yaskawa.hses import Answer, Read, decode
from protocol_gateway.driver_parts.one_motion import FIRST_PERCENT, OneMotion, Phase, prepared
from protocol_gateway.driver_parts.polling import Polling, Regular
from protocol_gateway.driver_parts.rest import Rest, near
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    Capabilities,
    Carries,
    Channel,
    Close,
    ControllerCommand,
    ControllerEvent,
    Effect,
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
    Severity,
    SoftwareReceived,
    Speed,
    StatusReceived,
    Stop,
    StopEnds,
)
from protocol_gateway.seam.errors import GatewaySettingsError, NotReadyError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robots.kinematics.joints import JointType

STOP = Channel(name="stop", carries=Carries.STOP, datagrams=True)
MOTION = Channel(name="motion", carries=Carries.MOTION, datagrams=True)
STOP_MEANS = "HOLD, kept until RESET"

START_S = 1.0
"""Time within which a motion must be seen to have started."""
_STATUS_S = 0.1
_FRESH_S = 0.6
_BLIND_S = 1.0
_REPEAT_S = 0.2
_REFUSED_S = 1.0
_REOPEN_S = 1.0
_ENDED_S = 0.5
_OTHERS_S = 1.0
_BASE_EACH_S = 2.0
_STILL = {JointType.ROTARY: 1e-3, JointType.PRISMATIC: 1e-4}
_ARRIVED = {JointType.ROTARY: 2e-3, JointType.PRISMATIC: 2e-4}
# Numbers of questions on the channel `stop` are below, those of HOLD are from here.
_FIRST_HOLD = 128
_NUMBERS = 256
_NO_SUCH_GROUP, _NO_SUCH_GROUP_ADDED = 0x28, frozenset({0xA001, 0xB008})
_LAST_TOOL = 63


class _Hold(Enum):
    """HOLD of this driver: none, wanted until RESET, and ending, until the status shows that it has ended."""

    NONE = auto()
    WANTED = auto()
    ENDING = auto()


@dataclass
class _Sent:
    """Data of a motion that was sent.

    Attributes:
        answered: The controller has accepted it.
        refused: The controller has refused it, or a copy of it.
        quiet_s: Since then no motion runs; None: one runs.
        arrived_s: Since then the arm is at the target; None: it is not.
    """

    number: int
    sent_s: float
    start: tuple[float, ...]
    target: tuple[float, ...]
    tool: int
    answered: bool = False
    refused: Refused | None = None
    refused_s: float = 0.0
    quiet_s: float | None = None
    arrived_s: float | None = None


class HsesMotionDriver(HsesDriver):
    """Driver of HSES that moves a robot.

    Raises:
        GatewaySettingsError: As `HsesDriver`; or if the settings do not say how to move the robot.
    """

    def __init__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None = None,
        options: object = None,
    ) -> None:
        assert isinstance(options, YaskawaSettings)
        super().__init__(joint_types, codes, relay=relay, options=options)
        if self._axes is None:
            raise GatewaySettingsError("yaskawa motion needs pulses_per_degree")
        if options.group[0] != "R":
            text = f"yaskawa motion: a robot, R1 to R8, can be moved, not {options.group}"
            raise GatewaySettingsError(text)
        self._robot = instance_of(options.group)
        self._still_within = tuple(_STILL[each] for each in joint_types)
        self._arrived_within = tuple(_ARRIVED[each] for each in joint_types)
        reading = self.capabilities
        self.capabilities = Capabilities(
            commands=frozenset({MoveAbsolute, Speed, Stop, Reset}),
            first_speed_percent=FIRST_PERCENT,
            absolute=True,
            dies_with_link=False,
            no_joints=reading.no_joints,
            reports_pose=reading.reports_pose,
            joint_mapping=reading.joint_mapping,
            experimental=True,
            stop_means=STOP_MEANS,
        )
        # With the status, HOLD on both channels until it is seen, and the question for a base.
        self.requests_a_second += 1.0 / _STATUS_S + 2.0 / _REPEAT_S + 2.0
        self._forget()

    def _forget(self) -> None:
        self._opened: set[str] = set()
        self._stop_polling: Polling[Read] = Polling((), ())
        self._number = 0
        self._hold_number = _FIRST_HOLD
        self._hold_sent_s = self._release_sent_s = float("-inf")
        self._refused_hold = ""
        self._state: Status | None = None
        self._state_s = self._answered_s = float("-inf")
        self._place: Position | None = None
        # A stop may end in HOLD, in an alarm, or with the servos off.
        self._rest = Rest(self._still_within, frozenset(Activity))
        # At first a motion of an earlier gateway may go on when HOLD ends.
        self._motion: OneMotion[_Sent] = OneMotion(Phase.LEFT)
        self._percent = FIRST_PERCENT
        self._has_base: bool | None = None
        self._hold = _Hold.NONE
        # Software of the controller; whether that behind the present socket is known to be the same.
        self._software = ""
        self._same = True

    # ------------------------------------------------------------------- channels

    def started(self, now_s: float) -> Effects:
        """Open the sockets."""
        self._forget()
        return (*super().started(now_s), Open(STOP), Open(MOTION))

    def controlled(self, taken: bool, now_s: float) -> Effects:
        """Begin with a low speed."""
        self._percent = FIRST_PERCENT
        return ()

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Begin to ask."""
        self._opened.add(channel.name)
        if channel is HSES:
            self._same = not self._software
            return super().opened(channel, now_s)
        if channel is STOP:
            self._has_base = None
            regular = [Regular(STATUS, _STATUS_S), Regular(self._base_axes, _BASE_EACH_S)]
            self._stop_polling = Polling(regular, (STATUS, self._base_axes), numbers=_FIRST_HOLD)
            self._answered_s = now_s
            return (SetTimer(now_s + _BLIND_S, "blind"), *self._ask(now_s))
        return ()

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Give a motion up that needs the connection."""
        effects: list[Effect] = [*super().closed(channel, now_s)] if channel is HSES else []
        if channel.name in self._opened:
            self._opened.discard(channel.name)
            effects += self._lost(channel, now_s)
        return effects

    def _lost(self, channel: Channel, now_s: float) -> Effects:
        if channel is HSES:
            # The next connection may reach another controller, where no speed was set.
            self._percent, self._place = FIRST_PERCENT, None
            self._rest.forget()
        effects: list[Effect] = []
        if channel is STOP:
            self._stop_polling, self._state = Polling((), ()), None
            effects += (SetTimer(None, "blind"), SetTimer(None, "ask"))
        if self._motion.sent:
            effects += self._give_up(hses_codes.CHANNEL_LOST(name=channel.name), now_s)
        return effects

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Go on: each datagram is whole."""
        return super().skipped(channel, now_s) if channel is HSES else ()

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Take an answer."""
        if channel is HSES:
            return super().received(channel, data, now_s)
        try:
            answer = decode(data)
        except ValueError:
            return ()
        if channel is MOTION:
            return self._motion_answered(answer, now_s)
        return self._stop_answered(answer, now_s)

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Ask, repeat HOLD, and look for what has not happened."""
        effects: list[Effect] = []
        if "hold" in ended:
            effects += self._keep_hold(now_s)
        if "ask" in ended and STOP.name in self._opened:
            effects += self._ask(now_s)
        if "blind" in ended and STOP.name in self._opened:
            effects += self._look(now_s)
        if "reopen" in ended:
            effects.append(Open(STOP))
        if "" in ended:
            effects += super().timer_ended(ended, now_s)
        return effects

    # ------------------------------------------------------------ the channel of the stop

    def _ask(self, now_s: float) -> Effects:
        before = self._stop_polling.asked
        asked = self._stop_polling.next_question(now_s)
        wake_s = self._stop_polling.wake_s()
        effects: list[Effect] = [] if wake_s is None else [SetTimer(wake_s, "ask")]
        if asked is not None and asked is not before:
            effects.append(Send(STOP, asked.read.encode(asked.number)))
        return effects

    def _look(self, now_s: float) -> Effects:
        """Open the socket of the stop again if nothing answers on it."""
        if now_s - self._answered_s < _BLIND_S:
            return (SetTimer(self._answered_s + _BLIND_S, "blind"),)
        self._opened.discard(STOP.name)
        again = SetTimer(now_s + _REOPEN_S, "reopen")
        return (again, *self._lost(STOP, now_s), Close(STOP, "nothing answers"))

    def _stop_answered(self, answer: Answer, now_s: float) -> Effects:
        if answer.service == commands.WRITE_SINGLE:
            return self._hold_answered(answer, now_s)
        asked = self._stop_polling.take(answer, now_s)
        effects: list[Effect] = []
        if asked is not None and asked.read == STATUS and not answer.status:
            try:
                status = payloads.status(answer.data)
            except ValueError:
                return self._ask(now_s)
            effects += self._status_seen(status, asked.at_s, now_s)
        elif asked is not None and asked.read == self._base_axes:
            self._base_answered(answer)
        return (*effects, *self._ask(now_s))

    def _base_answered(self, answer: Answer) -> None:
        """Note whether the robot has a base, which a motion of the robot would move as well."""
        if answer.busy:
            return
        if answer.status:
            absent = answer.status == _NO_SUCH_GROUP or answer.added_status in _NO_SUCH_GROUP_ADDED
            self._has_base = False if absent else None
            return
        try:
            self._has_base = any(payloads.axis_names(answer.data))
        except ValueError:
            self._has_base = None

    def _hold_answered(self, answer: Answer, now_s: float) -> Effects:
        """Report once that HOLD, or its end, was refused."""
        if answer.number != self._hold_number or not answer.status or answer.busy:
            return ()
        effects: list[Effect] = [SetTimer(now_s + _REFUSED_S, "hold")] if self._hold is _Hold.WANTED else []
        if self._refused_hold == answer.error:
            return effects
        self._refused_hold = answer.error
        what = "HOLD" if self._hold is _Hold.WANTED else "the end of HOLD"
        text = f"the controller refuses {what}: {answer.error}"
        return [*effects, Report([AlarmReceived(Severity.ERROR, text, f"{answer.added_status:04X}")], 0)]

    # ------------------------------------------------------------------------ HOLD

    def _send_hold(self, now_s: float, *, on: bool) -> list[Effect]:
        """Return the effects that send HOLD or its end now."""
        self._hold_number = max((self._hold_number + 1) % _NUMBERS, _FIRST_HOLD)
        datagram = commands.hold(self._hold_number, on=on)
        if not on:
            self._release_sent_s = now_s
            return [Send(STOP, datagram)]
        self._hold_sent_s = now_s
        effects: list[Effect] = [
            SetTimer(now_s + _REPEAT_S, "hold"),
            Send(STOP, datagram, alternative=True),
        ]
        if HSES.name in self._opened:
            effects.append(Send(HSES, datagram, alternative=True))
        return effects

    def stop_ends_now(self, now_s: float) -> StopEnds | None:
        """Return whose motion HOLD ends: a job's, too; controllers refuse it unless they are in remote."""
        if self._state is None or mode_of(self._state) is not Mode.REMOTE:
            return None
        return StopEnds.ANY

    def _keep_hold(self, now_s: float) -> list[Effect]:
        """Send HOLD again unless the controller is known to be on HOLD, or in local control."""
        if self._hold is not _Hold.WANTED:
            return []
        later: list[Effect] = [SetTimer(now_s + _REPEAT_S, "hold")]
        if not self._same:
            # It may be another controller, for which no stop was proven.
            return later
        if self._fresh(now_s) and self._state is not None and self._state_s >= self._hold_sent_s:
            if self._state.second & Status2.HELD_BY_COMMAND:
                return later
            if self._refused_hold and mode_of(self._state) is not Mode.REMOTE:
                return later
        return self._send_hold(now_s, on=True) if self._opened & {STOP.name, HSES.name} else later

    def _fresh(self, now_s: float) -> bool:
        """Return whether the newest status is new enough to act on."""
        return self._state is not None and now_s - self._state_s < _FRESH_S

    # ---------------------------------------------------------------------- motion

    def _status_seen(self, status: Status, asked_s: float, now_s: float) -> Effects:
        """Follow the motion by a status that was asked for at a time."""
        self._state, self._state_s, self._answered_s = status, asked_s, now_s
        running, held = status.first & Status1.RUNNING, status.second & HELD
        if status.second & Status2.HELD_BY_COMMAND:
            self._refused_hold = ""
        if self._motion.sent:
            return self._follow(self._motion.sent, status, asked_s, now_s)
        settled = asked_s > max(self._release_sent_s, self._hold_sent_s)
        if settled and not running and not held and self._hold is not _Hold.WANTED:
            self._hold = _Hold.NONE
            self._motion.end()
        return ()

    def _follow(self, motion: _Sent, status: Status, asked_s: float, now_s: float) -> Effects:
        if asked_s < motion.sent_s:
            return ()
        running = bool(status.first & Status1.RUNNING)
        here_s, here = self._rest.positions_s, self._rest.positions
        if here is None or here_s <= motion.sent_s:
            here = None
        moved = here is not None and not near(here, motion.start, self._arrived_within)
        begun = self._motion.phase is Phase.RUNS
        if motion.refused is not None and not (motion.answered or begun or running or moved):
            if min(asked_s, here_s) > motion.refused_s:
                self._motion.leave()
                return (Report([motion.refused], 0),)
            # Without a newer position it is unknown whether a copy of the motion moves the arm.
            return self._give_up(hses_codes.STATE_OLD(), now_s) if now_s - here_s > _BLIND_S else ()
        if (problem := _stopped(status)) is not None:
            return self._give_up(problem, now_s)
        if status.second & HELD:
            return self._give_up(hses_codes.HELD(), now_s)
        if mode_of(status) is not Mode.REMOTE:
            return self._give_up(hses_codes.WENT_LOCAL(), now_s)
        if now_s - here_s > _BLIND_S:
            return self._give_up(hses_codes.STATE_OLD(), now_s)
        if self._place is not None and self._place.tool != motion.tool:
            return self._give_up(hses_codes.TOOL_CHANGED(), now_s)
        arrived = here is not None and near(here, motion.target, self._arrived_within)
        if not arrived:
            motion.arrived_s = None
        elif motion.arrived_s is None:
            motion.arrived_s = now_s
        if running or moved:
            self._motion.begin()
        if running:
            motion.quiet_s = None
            if motion.arrived_s is not None and now_s - motion.arrived_s > _OTHERS_S:
                return self._give_up(hses_codes.OTHER_JOB(), now_s)
            return ()
        begun = self._motion.phase is Phase.RUNS
        motion.quiet_s = now_s if motion.quiet_s is None else motion.quiet_s
        if arrived and (motion.answered or begun):
            self._motion.end()
            return ()
        if begun and now_s - motion.quiet_s >= _ENDED_S:
            return self._give_up(hses_codes.ENDED_ELSEWHERE(), now_s)
        if not begun and now_s - motion.sent_s >= START_S:
            return self._give_up(hses_codes.NOT_STARTED(seconds=START_S), now_s)
        return ()

    def _motion_answered(self, answer: Answer, now_s: float) -> Effects:
        motion = self._motion.sent
        late = motion is None or motion.number != answer.number or motion.answered
        if motion is None or late or answer.service != commands.WRITE_ALL:
            return ()
        if not answer.status:
            motion.answered = True
            return ()
        # The next status decides: of a motion that the network doubled, the second is refused, and answers
        # may overtake each other.
        motion.refused, motion.refused_s = Refused(answer.added_status or answer.status, answer.error), now_s
        return ()

    def _give_up(self, why: Reason, now_s: float) -> Effects:
        """Set HOLD, and have a stop latched."""
        self._stop_now(moved=True)
        return (*self._send_hold(now_s, on=True), FateUnknown(why))

    def _stop_now(self, *, moved: bool) -> None:
        """Want HOLD, and a proof of rest.

        Args:
            moved: The arm may have moved since the newest position.
        """
        self._rest.prove_again(moved=moved)
        if moved:
            self._motion.leave()
        self._hold = _Hold.WANTED
        self._refused_hold = ""

    # ----------------------------------------------------------------------- answers

    def _status(self, status: Status, now_s: float) -> list[ControllerEvent]:
        return [
            self._proven(each, now_s) if isinstance(each, StatusReceived) else each
            for each in super()._status(status, now_s)
        ]

    def _proven(self, status: StatusReceived, now_s: float) -> StatusReceived:
        """Return a status that says "moves" after a stop until rest is proven."""
        # Of two statuses on two sockets, the later one may be the older one.
        runs = self._motion.sent is not None
        runs |= self._state is not None and bool(self._state.first & Status1.RUNNING)
        # Up to the newest position, because later motion is unknown.
        at_s = self._rest.positions_s
        until_s = at_s if now_s - at_s < _FRESH_S else float("-inf")
        return replace(status, activity=self._rest.reported(status.activity, until_s, runs=runs))

    def _on_system(self, system: payloads.System) -> list[ControllerEvent]:
        events = super()._on_system(system)
        for each in events:
            if isinstance(each, SoftwareReceived):
                if self._software not in ("", each.version):
                    self._hold = _Hold.NONE
                self._software, self._same = each.version, True
        return events

    def _joints(self, position: Position, now_s: float) -> list[ControllerEvent]:
        events = super()._joints(position, now_s)
        for each in events:
            if isinstance(each, JointsReceived):
                self._place = position
                self._rest.at(each.positions, now_s)
        return events

    # ---------------------------------------------------------------------- commands

    def prepare(self, *commands: ControllerCommand) -> tuple[ControllerCommand, ...]:
        """Return commands that can be sent; at most one motion, as the last one.

        Raises:
            CommandError: If they cannot be expressed.
        """
        return prepared(commands, len(self._arrived_within))

    def command(self, prepared: Sequence[ControllerCommand], now_s: float) -> Effects:
        """Send what `prepare` returned.

        Raises:
            NotReadyError: If a motion cannot be sent now, or HOLD cannot end now.
        """
        effects: list[Effect] = []
        percent = self._percent
        # Raise every refusal before the state changes: all commands are sent, or none.
        kinds = {type(each) for each in prepared}
        if Reset in kinds and (obstacle := self._reset_obstacle(now_s)) is not None:
            raise NotReadyError(obstacle)
        if MoveAbsolute in kinds and (obstacle := self._obstacle(now_s, resets=Reset in kinds)) is not None:
            raise NotReadyError(obstacle)
        pulses = [self._pulses(each.positions) for each in prepared if isinstance(each, MoveAbsolute)]
        for command in prepared:
            match command:
                case Stop():
                    effects += self._stop(now_s)
                case Reset():
                    effects += self._reset(now_s)
                case Speed(new_percent):
                    percent = new_percent
                case MoveAbsolute(target):
                    effects += self._move(target, pulses[0], percent, now_s)
        self._percent = percent
        return effects

    def _stop(self, now_s: float) -> Effects:
        self._stop_now(moved=self._motion.sent is not None or not self._at_rest(now_s))
        return self._send_hold(now_s, on=True)

    def _at_rest(self, now_s: float) -> bool:
        """Return whether nothing runs and nothing is held, except by a stop before."""
        if not self._fresh(now_s) or self._state is None:
            return False
        ours = self._hold is not _Hold.NONE and self._motion.phase is Phase.NONE
        held = self._state.second & HELD and not ours
        return not self._state.first & Status1.RUNNING and not held

    def _reset_obstacle(self, now_s: float) -> Reason | None:
        """Return why HOLD cannot end now: the state is not known, or something may go on; None: it can."""
        if self._hold is _Hold.NONE:
            return None
        state = self._state
        if state is None or not self._fresh(now_s) or self._state_s < self._hold_sent_s:
            return hses_codes.STATE_OLD()
        held = state.second & Status2.HELD_BY_COMMAND
        if held and self._motion.phase is not Phase.NONE and state.second & Status2.SERVO_ON:
            return hses_codes.HELD_MOTION()
        return None

    def _reset(self, now_s: float) -> Effects:
        """End HOLD if this driver has set it."""
        if self._hold is _Hold.NONE:
            return ()
        self._hold = _Hold.ENDING
        no_more = SetTimer(None, "hold")
        if self._state is None or not self._state.second & Status2.HELD_BY_COMMAND:
            self._hold = _Hold.NONE
            return (no_more,)
        self._refused_hold = ""
        return (no_more, *self._send_hold(now_s, on=False))

    def _pulses(self, target: Sequence[float]) -> Sequence[int]:
        """Return the pulses of a target.

        Raises:
            NotReadyError: If a motion cannot hold them.
        """
        assert self._axes is not None
        pulses = self._axes.pulses(np.array(target, dtype=float))
        if any(abs(each) > commands.LONGEST_NUMBER for each in pulses):
            raise NotReadyError(hses_codes.AXES(detail="the target has more pulses than a motion can hold"))
        return pulses

    def _move(self, target: Sequence[float], pulses: Sequence[int], percent: float, now_s: float) -> Effects:
        assert self._place is not None
        assert self._rest.positions is not None
        self._number = (self._number + 1) % _NUMBERS
        tool = self._place.tool
        self._motion.send(_Sent(self._number, now_s, self._rest.positions, tuple(target), tool))
        datagram = commands.motion(self._number, robot=self._robot, percent=percent, pulses=pulses, tool=tool)
        return (Send(MOTION, datagram),)

    def _obstacle(self, now_s: float, *, resets: bool) -> Reason | None:
        """Return why no motion can be sent now; None: it can.

        Args:
            resets: A reset precedes it, so the driver itself does not want HOLD any longer.
        """
        missing = [each.name for each in (HSES, STOP, MOTION) if each.name not in self._opened]
        if missing:
            return hses_codes.CHANNEL_MISSING(name=missing[0])
        state, place, place_s = self._state, self._place, self._rest.positions_s
        if state is None or place is None or not self._fresh(now_s) or now_s - place_s > _FRESH_S:
            return hses_codes.STATE_OLD()
        if (extra := self._other_axes(place)) is not None:
            return extra
        if place.tool > _LAST_TOOL:
            detail = f"the controller reports tool {place.tool}; it must be 0 to {_LAST_TOOL}"
            return hses_codes.AXES(detail=detail)
        if self._motion.sent:
            return hses_codes.MOVES()
        if state.second & HELD or (self._hold is _Hold.WANTED and not resets):
            return codes.CONTROLLER_HOLDING()
        if mode_of(state) is not Mode.REMOTE:
            return codes.CONTROLLER_LOCAL()
        if (stopped := _stopped(state)) is not None:
            return stopped
        return hses_codes.OTHER_JOB() if state.first & Status1.RUNNING else None

    def _other_axes(self, place: Position) -> Reason | None:
        """Return why a motion may move, or leave out, an axis that is not the model's; None: it does not."""
        assert self._axes is not None
        if not self._names or self._has_base is None:
            return hses_codes.AXES(detail="which axes the controller has is not known yet")
        if self._has_base:
            return hses_codes.AXES(detail=f"{self._group} has a base, which the motion would move too")
        used = self._axes.used
        named = [name for each, name in enumerate(self._names) if name and each not in used]
        moved = [str(each + 1) for each, at in enumerate(place.axes) if at and each not in used]
        if extra := ", ".join(named or moved):
            return hses_codes.AXES(detail=f"axis {extra} belongs to no joint of the model")
        return None


def _stopped(status: Status) -> Reason | None:
    """Return why the controller does not let the arm move; None: it does."""
    if status.second & (Status2.ALARM | Status2.ERROR):
        return hses_codes.ARM_STOPPED(state="an alarm or error is active")
    if not status.second & Status2.SERVO_ON:
        return hses_codes.ARM_STOPPED(state="the servos are off")
    return None


def hses_driver(joint_types: Sequence[JointType], codes: Mapping[int, str], **given: Any) -> HsesDriver:
    """Create the driver that only reads, unless the site file declares motion."""
    options = given["options"]
    moves = isinstance(options, YaskawaSettings) and options.motion
    return (HsesMotionDriver if moves else HsesDriver)(joint_types, codes, **given)
