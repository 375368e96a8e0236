"""Client of the dashboard server, without I/O: whether the robot is in remote control, and the stop.

One line each way; answers come in the order of the commands. A connection that was opened in local control
stays restricted, so it is used for the question only.
"""

from collections import deque
from enum import Enum, auto

from robomesh.texts import one_line

QUESTION = b"is in remote control\n"
STOP = b"stop\n"
_LONGEST_LINE = 1000


class _Expected(Enum):
    GREETING = auto()
    MODE = auto()
    STOP = auto()


class Dashboard:
    """One connection after the other to the dashboard server.

    Attributes:
        remote: The robot is in remote control; None: unknown.
        answered_s: Time of that answer.
        asked_s: Time of the question without an answer; None: there is none.
        was_local: The connection was answered in local control, so it is restricted.
        lost: The connection cannot be read.
        refusals: Answers to a stop other than that it was done, since the last look.
    """

    def __init__(self) -> None:
        self.opened()

    def opened(self) -> None:
        """Forget the previous connection."""
        self.remote: bool | None = None
        self.answered_s = float("-inf")
        self.asked_s: float | None = None
        self.was_local = self.lost = False
        self.refusals: list[str] = []
        self._line = b""
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

    def receive(self, data: bytes, now_s: float) -> None:
        """Take the next bytes, split anywhere."""
        *lines, self._line = (self._line + data).split(b"\n")
        for line in lines:
            self._take(one_line(line.decode("latin-1").strip(), 200), now_s)
        if len(self._line) > _LONGEST_LINE:
            self.lost = True

    def _take(self, line: str, now_s: float) -> None:
        match self._expected.popleft() if self._expected else None:
            case _Expected.MODE:
                self.asked_s = None
                self.remote = {"true": True, "false": False}.get(line.lower())
                self.answered_s = now_s
                self.was_local = self.was_local or self.remote is False
            case _Expected.STOP if line != "Stopped":
                self.refusals.append(line)
            case None:
                # Which answer belongs to which command is not known any longer.
                self.lost = True
