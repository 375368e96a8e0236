"""Conditions of robots: faults that last as long as the gateway's reported state says so.

A condition begins after it has held for a minimum time, and ends when it no longer holds. Pure.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE
from robomesh.contract.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import ControllerState
from robomesh.schemas.robomesh_pb2 import Reason as ReasonMessage

# A site's simulated controllers start beside their gateways, each in some seconds on a slow machine.
_LINK_AFTER_S = 3.0
_CHECK_AFTER_S = 20.0
_SILENT_AFTER_S = 6.0
# Longer than the gateway takes to drop a frozen controller and reconnect.
_WORDS_AFTER_S = 10.0
_LINK = {ControllerState.DOWN: "link.down", ControllerState.SILENT: "link.silent"}


@dataclass(frozen=True, kw_only=True)
class Condition:
    """A fault that holds now.

    Attributes:
        cause: The reason in the text; None if it has no code.
        what: Part of the alarm's id, with the robot and `each`; usually the code.
        reported: Another service has published an event for it.
        latching: It may last for good, so acknowledging its alarm clears the alarm.
        after_s: Minimum time that it must hold before it begins.
        words_after_s: Minimum time before a changed text is published; the cause may alternate.
        gist: Part of the text that must change for a new publication, where a number in the text keeps
            counting.
    """

    robot: str = WHOLE_SITE
    source: str = "watch"
    code: str
    text: str
    over: str = ""
    what: str = ""
    each: str = ""
    values: tuple[tuple[str, str], ...] = ()
    cause: ReasonMessage | None = None
    reported: bool = False
    latching: bool = False
    after_s: float = 0.0
    words_after_s: float = 0.0
    gist: str = ""

    @property
    def id(self) -> str:
        """Return the id of its alarm."""
        return alarm_id(self.robot, self.what or self.code, self.each)

    @property
    def words(self) -> tuple[str, str]:
        """Return what must change for the text to be published again."""
        return self.code, self.gist or self.text


def alarm_id(robot: str, what: str, each: str = "") -> str:
    """Return a stable alarm id: "pt600-1:link", "-:clock.off:host-b"."""
    return ":".join(filter(None, (robot, what, each)))


def condition_of(reason: Reason, **more: Any) -> Condition:
    """Return a condition whose text is a reason's sentence."""
    return Condition(text=reason.text, cause=reason_message(reason), **more)


@dataclass
class ConditionTracker:
    """The conditions that have begun.

    Attributes:
        active: The conditions by alarm id, with the text that was published last.
    """

    active: dict[str, Condition] = field(default_factory=dict)
    _since: dict[str, float] = field(default_factory=dict)
    # Changed texts that are not published yet, and the time since they hold.
    _words: dict[str, tuple[str, float]] = field(default_factory=dict)

    def update(
        self, conditions: Iterable[Condition], now_s: float
    ) -> tuple[list[Condition], list[Condition], list[Condition]]:
        """Return the conditions that began, those whose text changed, and those that ended.

        Args:
            now_s: Monotonic time [s].
        """
        there = {condition.id: condition for condition in conditions}
        self._since = {name: self._since.get(name, now_s) for name in there}
        began, changed = [], []
        for name, condition in there.items():
            before = self.active.get(name)
            if before is None:
                if now_s - self._since[name] < condition.after_s:
                    continue
                began.append(condition)
            elif before.words != condition.words:
                if now_s - self._words_since(name, condition, now_s) < condition.words_after_s:
                    continue
                changed.append(condition)
            self.active[name] = condition
        over = [condition for name, condition in self.active.items() if name not in there]
        for condition in over:
            del self.active[condition.id]
            self._words.pop(condition.id, None)
        return began, changed, over

    def _words_since(self, name: str, condition: Condition, now_s: float) -> float:
        text, since_s = self._words.get(name, ("", now_s))
        if text != condition.text:
            since_s = now_s
        self._words[name] = condition.text, since_s
        return since_s


def robot_conditions(robot: str, state: ControllerState, age_s: float) -> Iterator[Condition]:
    """Yield the faults in a robot's last reported controller state.

    Args:
        age_s: Age of the report. A gateway that has gone reports no end.
    """

    def condition(code: str, text: str, **more: Any) -> Condition:
        return Condition(robot=robot, source="gateway", code=code, text=text, reported=True, **more)

    def stated(code: str, reason: Reason) -> Condition:
        return condition_of(reason, robot=robot, source="gateway", code=code, reported=True)

    if age_s > _SILENT_AFTER_S:
        yield condition_of(
            codes.GATEWAY_SILENT(robot=robot, seconds=_SILENT_AFTER_S),
            robot=robot,
            code="gateway.silent",
            over=f"the gateway of {robot} reports again, or is known to be gone",
        )
    if state.link in _LINK:
        text = f"link to the controller: {state.link_text or 'not up'}"
        # The gateway drops a frozen controller and reconnects, again and again: that is one alarm.
        yield condition(
            _LINK[state.link],
            text,
            cause=_one_reason(state.link_reasons),
            what="link",
            after_s=_LINK_AFTER_S,
            words_after_s=_WORDS_AFTER_S,
        )
    if state.fault or state.activity == ControllerState.FAULT:
        if state.fault:
            yield stated("controller.fault", codes.FAULT_REPORTED(fault=state.fault))
        else:
            yield condition("controller.fault", "the controller has a fault and does not report which")
    if state.mode == ControllerState.LOCAL:
        yield condition("controller.local", "the controller is in local mode: the mesh cannot move the robot")
    if state.HasField("stop"):
        stop = state.stop
        code = codes.STOP_LATCHED_WHY if stop.reason else codes.STOP_LATCHED_BY
        yield stated("stop.latched", code(id=stop.id, by=stop.by, reason=stop.reason))
    if state.health.flooding:
        yield condition("link.flooding", "the controller sends far too much: only the newest is published")
    if state.check_text and not state.check_starting:
        yield condition(
            "check.missing",
            f"motions are not checked: {state.check_text}",
            cause=state.check_reason if state.HasField("check_reason") else None,
            after_s=_CHECK_AFTER_S,
        )


def _one_reason(reasons: Sequence[ReasonMessage]) -> ReasonMessage | None:
    """Return one reason for several; None without any, as from an older gateway."""
    if len(reasons) < 2:
        return reasons[0] if reasons else None
    return ReasonMessage(
        code=codes.SEVERAL.name, causes=reasons, text="; ".join(each.text for each in reasons)
    )
