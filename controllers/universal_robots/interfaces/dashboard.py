"""Client of the dashboard server, without I/O: whether the robot is in remote control, stop, recoveries.

One line each way; answers come in the order of the commands. A connection that was opened in local control
stays restricted, so it is used for the question only.
"""

from collections import deque
from collections.abc import Mapping
from enum import Enum, auto

from protocol_gateway.seam import RecoverAnswered, Recovery
from robomesh.texts import one_line

QUESTION = b"is in remote control\n"
STOP = b"stop\n"
RECOVERIES: Mapping[Recovery, tuple[bytes, str]] = {
    Recovery.UNLOCK_PROTECTIVE_STOP: (b"unlock protective stop\n", "Protective stop releasing"),
    Recovery.CLOSE_SAFETY_POPUP: (b"close safety popup\n", "closing safety popup"),
    Recovery.RESTART_SAFETY: (b"restart safety\n", "Restarting safety"),
    Recovery.POWER_ON: (b"power on\n", "Powering on"),
    Recovery.BRAKE_RELEASE: (b"brake release\n", "Brake releasing"),
}
"""Command of each recovery, and the answer of a controller that has taken it."""
_LONGEST_LINE = 1000


class _Expected(Enum):
    GREETING = auto()
    MODE = auto()
    STOP = auto()
    RECOVERY = auto()


class Dashboard:
    """One connection after the other to the dashboard server.

    Attributes:
        remote: The robot is in remote control; None: unknown.
        answered_s: Time of that answer.
        asked_s: Time of the question without an answer; None: there is none.
        was_local: The connection was answered in local control, so it is restricted.
        lost: The connection cannot be read.
        refusals: Answers to a stop other than that it was done, since the last look.
        recovery: Recovery without an answer; None: there is none.
        recovery_s: Time at which it was sent.
        answers: Answers to recoveries since the last look, with the lost ones.
    """

    def __init__(self) -> None:
        self.recovery: Recovery | None = None
        self.recovery_s = float("-inf")
        self.answers: list[RecoverAnswered] = []
        self.opened()

    def opened(self) -> None:
        """Forget the previous connection."""
        self.remote: bool | None = None
        self.answered_s = float("-inf")
        self.asked_s: float | None = None
        self.was_local = self.lost = False
        self.refusals: list[str] = []
        self._line = b""
        if self.recovery is not None:
            self._answer(None, "no answer before the connection ended")
        self._expected = deque([_Expected.GREETING])

    def ask(self, now_s: float) -> bytes:
        """Return the question for the mode."""
        self.asked_s = now_s
        self._expected.append(_Expected.MODE)
        return QUESTION

    def stop(self) -> bytes:
        """Return the command that ends the running program."""
        self._expected.append(_Expected.STOP)
        return STOP

    def recover(self, recovery: Recovery, now_s: float) -> bytes:
        """Return the command of a recovery."""
        self.recovery, self.recovery_s = recovery, now_s
        self._expected.append(_Expected.RECOVERY)
        return RECOVERIES[recovery][0]

    def _answer(self, accepted: bool | None, answer: str) -> None:
        assert self.recovery is not None
        self.answers.append(RecoverAnswered(self.recovery, accepted, answer))
        self.recovery = None

    def receive(self, data: bytes, now_s: float) -> None:
        """Take the next bytes, split anywhere."""
        *lines, self._line = (self._line + data).split(b"\n")
        for line in lines:
            # Compared as bytes: `one_line` replaces control characters by blanks.
            self._take(line.strip(b" \t\r"), now_s)
        if len(self._line) > _LONGEST_LINE:
            self.lost = True

    def _take(self, line: bytes, now_s: float) -> None:
        text = one_line(line.decode("latin-1"), 200)
        match self._expected.popleft() if self._expected else None:
            case _Expected.MODE:
                self.asked_s = None
                self.remote = {b"true": True, b"false": False}.get(line.lower())
                self.answered_s = now_s
                self.was_local = self.was_local or self.remote is False
            case _Expected.STOP if line != b"Stopped":
                self.refusals.append(text)
            case _Expected.RECOVERY if self.recovery is not None:
                expected = RECOVERIES[self.recovery][1].lower().encode("ascii")
                self._answer(line.lower().startswith(expected), text)
            case None:
                # Which answer belongs to which command is not known any longer.
                self.lost = True
