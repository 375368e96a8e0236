"""Timing of a video stream's key frames."""

from dataclasses import dataclass

INTERVAL_S = 2.0
# Lower limit for any number of new subscribers: key frames are many times larger than other frames.
SHORTEST_S = 1.0


@dataclass
class KeyFrameClock:
    """The key frame timer of one stream; all times on one monotonic clock [s].

    Attributes:
        last: Time of the last key frame; None: none yet.
        asked: The next picture must be a key frame.
    """

    last: float | None = None
    asked: bool = False

    def ask(self, now: float) -> bool:
        """Request a key frame; return False if the last one is recent enough to be used instead."""
        if self.last is not None and now - self.last < SHORTEST_S:
            return False
        self.asked = True
        return True

    def due(self, now: float) -> bool:
        """Return whether a picture made now must be a key frame."""
        return self.last is None or self.asked or now - self.last >= INTERVAL_S

    def made(self, now: float) -> None:
        """Record a key frame."""
        self.last, self.asked = now, False
