"""When a video stream has its next key frame."""

from dataclasses import dataclass

INTERVAL_S = 2.0
# However many join: key frames are many times the size of the others.
SHORTEST_S = 1.0


@dataclass
class KeyFrameClock:
    """One stream's; all times on one monotonic clock [s].

    Attributes:
        last: When the last key frame was; None: none yet.
        asked: One was asked for, and comes next.
    """

    last: float | None = None
    asked: bool = False

    def ask(self, now: float) -> bool:
        """Ask for a key frame; False: the last one is too young, and serves as well."""
        if self.last is not None and now - self.last < SHORTEST_S:
            return False
        self.asked = True
        return True

    def due(self, now: float) -> bool:
        """Whether a picture made now is to be a key frame."""
        return self.last is None or self.asked or now - self.last >= INTERVAL_S

    def made(self, now: float) -> None:
        """A key frame was made."""
        self.last, self.asked = now, False
