"""Base of drivers that read a controller by questions, one at a time on one channel."""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any, ClassVar, Generic, Protocol, TypeVar

from protocol_gateway.driver_parts.hexadecimal import hexadecimal
from protocol_gateway.driver_parts.only_reads import OnlyReads
from protocol_gateway.driver_parts.polling import Answered, Asked, Polling
from protocol_gateway.seam.effects import Channel, Effect, Effects, Open, Report, Send, SetTimer
from protocol_gateway.seam.events import ControllerEvent, MalformedReceived


class Question(Hashable, Protocol):
    """A question to the controller."""

    def encode(self, number: int) -> bytes:
        """Return its bytes with a number."""
        ...


Q = TypeVar("Q", bound=Question)
A = TypeVar("A", bound=Answered[Any])


class PollingReader(OnlyReads, ABC, Generic[Q, A]):
    """Base of drivers that read by questions on their `channel`; each answer is reported by itself."""

    channel: ClassVar[Channel]
    ports: frozenset[str] = frozenset()
    _polling: Polling[Q]

    @abstractmethod
    def _begin(self) -> None:
        """Forget the last connection, and set the questions of a new one."""

    @abstractmethod
    def _answers(self, data: bytes) -> Iterable[A | ValueError]:
        """Return the answers that are complete with the next bytes; of invalid bytes, the error."""

    @abstractmethod
    def _refusal(self, question: Q, answer: A, received: bytes) -> list[ControllerEvent]:
        """Return what to report of an answer that refuses a question."""

    @abstractmethod
    def _events(self, question: Q, answer: A, now_s: float) -> list[ControllerEvent]:
        """Return what an answer says; ValueError: it cannot be the answer to this question."""

    def started(self, now_s: float) -> Effects:
        """Open the site file's port."""
        return (Open(self.channel),)

    def opened(self, channel: Channel, now_s: float) -> Effects:
        """Begin to ask."""
        self._begin()
        return self._go_on(now_s)

    def received(self, channel: Channel, data: bytes, now_s: float) -> Effects:
        """Report answers, and ask the next question that is due."""
        effects: list[Effect] = []
        for answer in self._answers(data):
            if isinstance(answer, ValueError):
                effects.append(Report([malformed(data, str(answer))], 0))
                continue
            asked = self._polling.take(answer, now_s)
            if asked is not None:
                effects.append(self._report(asked, answer, data, now_s))
        return (*effects, *self._go_on(now_s))

    def skipped(self, channel: Channel, now_s: float) -> Effects:
        """Go on with the answer to the next question."""
        return self._go_on(now_s)

    def closed(self, channel: Channel, now_s: float) -> Effects:
        """Ask no more until the next connection."""
        self._polling = Polling((), ())
        return (SetTimer(None),)

    def timer_ended(self, ended: Mapping[str, float], now_s: float) -> Effects:
        """Ask the next question, or give up an answer that did not come."""
        return self._go_on(now_s)

    def _go_on(self, now_s: float) -> Sequence[Effect]:
        before, lost = self._polling.asked, self._polling.lost
        asked = self._polling.next_question(now_s)
        effects: list[Effect] = [SetTimer(self._polling.wake_s())]
        if asked is not None and asked is not before:
            effects.insert(0, Send(self.channel, asked.read.encode(asked.number)))
        if lost := self._polling.lost - lost:
            effects.append(Report([], 0, lost=lost))
        return effects

    def _report(self, asked: Asked[Q], answer: A, received: bytes, now_s: float) -> Report:
        if answer.busy:
            # Not a sign that the state is received: a controller that is always busy is silent.
            return Report([], 1, refusals=1, asked_s=asked.at_s)
        if answer.refused:
            return Report(self._refusal(asked.read, answer, received), 1, refusals=1, asked_s=asked.at_s)
        try:
            events = self._events(asked.read, answer, now_s)
        except ValueError as error:
            return Report([malformed(received, str(error))], 0)
        return Report(events, 1, asked_s=asked.at_s)


def malformed(received: bytes, reason: str) -> MalformedReceived:
    """Return the event of invalid bytes."""
    return MalformedReceived(0, hexadecimal(received), reason)
