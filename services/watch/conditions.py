"""What is so now and should not be, of robots: held by their gateway's own words for as long as they are so.

A condition begins when it has been so for a while, and goes when it is so no more. Pure.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from robomesh.keys import WHOLE_SITE
from robomesh.schemas.robomesh_pb2 import ControllerState

# When a site starts, its parts come one after the other.
_LINK_AFTER_S = 1.0
_CHECK_AFTER_S = 20.0
_SILENT_AFTER_S = 6.0
# Longer than it takes to give up a frozen controller and connect to it anew.
_WORDS_AFTER_S = 10.0
_LINK = {ControllerState.DOWN: "link.down", ControllerState.SILENT: "link.silent"}


@dataclass(frozen=True, kw_only=True)
class Condition:
    """Something that is so.

    Attributes:
        what: With the robot and `each` its alarm's name; usually the code.
        told: Somebody else has published an event of it.
        latching: To acknowledge it is to know it: it may stay so for good.
        after_s: So long it must be so to begin.
        words_after_s: So long other words must be so to be told: why it is so may change again and again.
        gist: What of the text must be another to be other words, where a number in it counts on.
    """

    robot: str = WHOLE_SITE
    source: str = "watch"
    code: str
    text: str
    over: str = ""
    what: str = ""
    each: str = ""
    values: tuple[tuple[str, str], ...] = ()
    told: bool = False
    latching: bool = False
    after_s: float = 0.0
    words_after_s: float = 0.0
    gist: str = ""

    @property
    def id(self) -> str:
        """Of its alarm."""
        return alarm_id(self.robot, self.what or self.code, self.each)

    @property
    def words(self) -> tuple[str, str]:
        """What is told anew when it changes."""
        return self.code, self.gist or self.text


def alarm_id(robot: str, what: str, each: str = "") -> str:
    """One name for the same thing each time: "pt600-1:link", "-:clock.off:host-b"."""
    return ":".join(filter(None, (robot, what, each)))


@dataclass
class Judge:
    """Which conditions have begun.

    Attributes:
        begun: By their alarm's name; the text that was last told.
    """

    begun: dict[str, Condition] = field(default_factory=dict)
    _since: dict[str, float] = field(default_factory=dict)
    # Other words than those told, and since when.
    _words: dict[str, tuple[str, float]] = field(default_factory=dict)

    def judge(
        self, conditions: Iterable[Condition], now_s: float
    ) -> tuple[list[Condition], list[Condition], list[Condition]]:
        """What has begun, what has other words now, and what is over.

        Args:
            now_s: On a clock that nobody sets.
        """
        there = {condition.id: condition for condition in conditions}
        self._since = {name: self._since.get(name, now_s) for name in there}
        began, changed = [], []
        for name, condition in there.items():
            before = self.begun.get(name)
            if before is None:
                if now_s - self._since[name] < condition.after_s:
                    continue
                began.append(condition)
            elif before.words != condition.words:
                if now_s - self._words_since(name, condition, now_s) < condition.words_after_s:
                    continue
                changed.append(condition)
            self.begun[name] = condition
        over = [condition for name, condition in self.begun.items() if name not in there]
        for condition in over:
            del self.begun[condition.id]
            self._words.pop(condition.id, None)
        return began, changed, over

    def _words_since(self, name: str, condition: Condition, now_s: float) -> float:
        text, since_s = self._words.get(name, ("", now_s))
        if text != condition.text:
            since_s = now_s
        self._words[name] = condition.text, since_s
        return since_s


def robot_conditions(robot: str, state: ControllerState, age_s: float) -> Iterator[Condition]:
    """What a robot's controller is in, as its gateway told it last.

    Args:
        age_s: Of what it told; a gateway that is gone says nothing of it being over.
    """

    def held(code: str, text: str, **more: Any) -> Condition:
        return Condition(robot=robot, source="gateway", code=code, text=text, told=True, **more)

    if age_s > _SILENT_AFTER_S:
        text = f"the gateway of {robot} has said nothing for more than {_SILENT_AFTER_S:g} s"
        over = f"the gateway of {robot} says something again, or is known to be gone"
        yield Condition(robot=robot, code="gateway.silent", text=text, over=over)
    if state.link in _LINK:
        text = f"link to the controller: {state.link_text or 'not up'}"
        # One that is frozen is silent, given up and connected to, again and again: that is one alarm.
        yield held(_LINK[state.link], text, what="link", after_s=_LINK_AFTER_S, words_after_s=_WORDS_AFTER_S)
    if state.fault or state.activity == ControllerState.FAULT:
        yield held(
            "controller.fault", f"the controller has a fault: {state.fault or 'it does not say which'}"
        )
    if state.mode == ControllerState.LOCAL:
        yield held("controller.local", "the controller is in local mode: nobody moves the robot from here")
    if state.HasField("stop"):
        stop = state.stop
        yield held(
            "stop.latched", f"stop {stop.id} is latched: {stop.reason or 'no reason given'}, by {stop.by}"
        )
    if state.health.flooding:
        yield held("link.flooding", "the controller sends far too much: only the newest is published")
    if state.check_text and not state.check_starting:
        yield held("check.missing", f"motions are not checked: {state.check_text}", after_s=_CHECK_AFTER_S)
