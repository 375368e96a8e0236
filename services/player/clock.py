"""Where in a recording a replay is: position by the monotonic clock, never added up."""

from dataclasses import dataclass

from robomesh import reason_codes as codes
from services.player.errors import ReplayError

SLOWEST, FASTEST = 0.1, 100.0


@dataclass
class Clock:
    """The position of a replay.

    Attributes:
        duration_s: Of the recording.
        now_s: The monotonic clock's time from which `begun_s` counts.
        begun_s: Position then.
    """

    duration_s: float
    now_s: float
    begun_s: float = 0.0
    speed: float = 1.0
    playing: bool = True
    loop: bool = False

    def position_s(self, now_s: float) -> float:
        """Position at a time of the monotonic clock, within the recording."""
        gone_s = (now_s - self.now_s) * self.speed if self.playing else 0.0
        return min(max(self.begun_s + gone_s, 0.0), self.duration_s)

    def at_end(self, now_s: float) -> bool:
        """Whether there is nothing more to play."""
        return self.position_s(now_s) >= self.duration_s

    def play(self, now_s: float) -> None:
        """Go on; from the beginning where the end was reached."""
        self._begin(0.0 if self.at_end(now_s) else self.position_s(now_s), now_s)
        self.playing = True

    def pause(self, now_s: float) -> None:
        """Stay where it is."""
        self._begin(self.position_s(now_s), now_s)
        self.playing = False

    def seek(self, position_s: float, now_s: float) -> None:
        """Go there.

        Raises:
            ReplayError: If the recording does not go there.
        """
        if not 0.0 <= position_s <= self.duration_s:
            raise ReplayError(codes.REPLAY_POSITION(seconds=position_s, most=self.duration_s))
        self._begin(position_s, now_s)

    def set_speed(self, speed: float, now_s: float) -> None:
        """Play faster or slower from here on.

        Raises:
            ReplayError: If it is not within 0.1 to 100.
        """
        if not SLOWEST <= speed <= FASTEST:
            raise ReplayError(codes.REPLAY_SPEED(speed=speed, least=SLOWEST, most=FASTEST))
        self._begin(self.position_s(now_s), now_s)
        self.speed = speed

    def _begin(self, position_s: float, now_s: float) -> None:
        self.begun_s, self.now_s = position_s, now_s
