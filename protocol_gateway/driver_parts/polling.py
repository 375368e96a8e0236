"""Choice of the next question: one at a time, each kind at its own rate, fewer while the controller is busy.

    idle --a question is due--> asked --its answer, or a timeout--> idle

An answer to an older question, or a second one to the same, is not used. No I/O and no clock.
"""

from collections import deque
from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

TIMEOUT_S = 0.3
"""Time after which an answer is lost: a controller answers within some tens of milliseconds."""
_SLOWEST = 16
_CALM_S = 10.0
# Pause before a question without an answer is repeated, so that others are asked too.
_AGAIN_S = 1.0


R = TypeVar("R", bound=Hashable)
R_contra = TypeVar("R_contra", contravariant=True)


class Answered(Protocol[R_contra]):
    """An answer of the controller."""

    @property
    def number(self) -> int:
        """The question's."""
        ...

    @property
    def busy(self) -> bool:
        """True if the controller has no time now for the question."""
        ...

    @property
    def refused(self) -> bool:
        """True if the controller does not do what was asked for."""
        ...

    def answers(self, read: R_contra) -> bool:
        """Return whether it can be the answer to a question with its number."""
        ...


@dataclass(slots=True)
class Regular(Generic[R]):
    """A question that is asked again and again.

    Attributes:
        period_s: Time from one to the next, if the controller is not busy.
        next_s: When it is due.
    """

    read: R
    period_s: float
    next_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Asked(Generic[R]):
    """The open question."""

    read: R
    number: int
    at_s: float


class Polling(Generic[R]):
    """Questions of one connection.

    Args:
        once: Asked first, in this order; again later if the answer is lost or the controller is busy.
        timeout_s: Time after which an answer is lost.
        numbers: Questions are numbered from 0 to one less than this, again and again.

    Attributes:
        slowness: The periods are longer by this factor, 1 to 16: it doubles with each busy answer, and halves
            again after ten seconds without one.
        asked: None: no answer is awaited.
        lost: Questions without an answer, so far.
    """

    def __init__(
        self,
        regular: Iterable[Regular[R]],
        once: Iterable[R],
        *,
        timeout_s: float = TIMEOUT_S,
        numbers: int = 256,
    ) -> None:
        self._regular = list(regular)
        self._once = deque(once)
        self._asks_once = False
        self._again: dict[R, float] = {}
        self.slowness = 1
        self._calm_since_s = 0.0
        self._timeout_s = timeout_s
        self._numbers = numbers
        self._number = 0
        self.asked: Asked[R] | None = None
        self.lost = 0

    def ask_once(self, read: R) -> None:
        """Ask a question before the regular ones."""
        if read not in self._once and (self.asked is None or self.asked.read != read):
            self._once.append(read)

    def drop(self, read: R) -> None:
        """Do not ask a question any more."""
        self._regular = [each for each in self._regular if each.read != read]

    def next_question(self, now_s: float) -> Asked[R] | None:
        """Return the question to send now; None: none is due, or an answer is awaited."""
        if self.asked is not None:
            if now_s < self.asked.at_s + self._timeout_s:
                return None
            self.lost += 1
            self._ask_again(self.asked, now_s)
            self.asked = None
        if self.slowness > 1 and now_s - self._calm_since_s >= _CALM_S:
            self.slowness //= 2
            self._calm_since_s = now_s
        read = self._due(now_s)
        if read is not None:
            self.asked = Asked(read, self._number, now_s)
            self._number = (self._number + 1) % self._numbers
        return self.asked

    def _ask_again(self, asked: Asked[R], now_s: float) -> None:
        """Ask a question again later that is not asked again and again."""
        if self._asks_once:
            self._again[asked.read] = now_s + _AGAIN_S * self.slowness

    def _due(self, now_s: float) -> R | None:
        again = next((read for read, at_s in self._again.items() if at_s <= now_s), None)
        if again is not None:
            del self._again[again]
        self._asks_once = again is not None or bool(self._once)
        if again is not None:
            return again
        if self._once:
            return self._once.popleft()
        due = [each for each in self._regular if each.next_s <= now_s]
        if not due:
            return None
        # The one that is late by most of its periods: a slow controller answers all kinds, each more seldom.
        chosen = max(due, key=lambda each: (now_s - each.next_s) / each.period_s)
        period_s = chosen.period_s * self.slowness
        # A grid keeps the rate; after a pause it starts again.
        chosen.next_s = max(chosen.next_s + period_s, now_s + period_s / 2)
        return chosen.read

    def wake_s(self) -> float | None:
        """Return when to call `next_question` again; None: there are no questions."""
        if self.asked is not None:
            return self.asked.at_s + self._timeout_s
        return min((*(each.next_s for each in self._regular), *self._again.values()), default=None)

    def take(self, answer: Answered[R], now_s: float) -> Asked[R] | None:
        """Return the question that an answer belongs to; None: it is late, or a duplicate."""
        asked = self.asked
        if asked is None or answer.number != asked.number or not answer.answers(asked.read):
            return None
        self.asked = None
        if answer.busy:
            self.slowness = min(self.slowness * 2, _SLOWEST)
            self._calm_since_s = now_s
            self._ask_again(asked, now_s)
            for each in self._regular:
                each.next_s = max(each.next_s, now_s + each.period_s * self.slowness / 2)
        return asked
