"""Position of a replay, computed from the monotonic clock instead of summed up, so that it does not drift."""

from dataclasses import dataclass

from robomesh import reason_codes as codes
from services.player.errors import ReplayError

SLOWEST, FASTEST = 0.1, 100.0


@dataclass
class Clock:
    """The position of a replay.

    Attributes:
        duration_s: Duration of the recording.
        now_s: Time of the monotonic clock at which the position was `begun_s`.
        begun_s: Position at that time.
    """

    duration_s: float
    now_s: float
    begun_s: float = 0.0
    speed: float = 1.0
    playing: bool = True
    loop: bool = False

    def position_s(self, now_s: float) -> float:
        """Return the position at a time of the monotonic clock, within the recording."""
        elapsed_s = (now_s - self.now_s) * self.speed if self.playing else 0.0
        return min(max(self.begun_s + elapsed_s, 0.0), self.duration_s)

    def at_end(self, now_s: float) -> bool:
        """Return whether the position is at the end."""
        return self.position_s(now_s) >= self.duration_s

    def play(self, now_s: float) -> None:
        """Start or resume; start again from the beginning if the position is at the end."""
        self._begin(0.0 if self.at_end(now_s) else self.position_s(now_s), now_s)
        self.playing = True

    def pause(self, now_s: float) -> None:
        """Stop at the current position."""
        self._begin(self.position_s(now_s), now_s)
        self.playing = False

    def seek(self, position_s: float, now_s: float) -> None:
        """Set the position.

        Raises:
            ReplayError: If it is outside the recording.
        """
        if not 0.0 <= position_s <= self.duration_s:
            raise ReplayError(codes.REPLAY_POSITION(seconds=position_s, most=self.duration_s))
        self._begin(position_s, now_s)

    def set_speed(self, speed: float, now_s: float) -> None:
        """Set the speed from the current position on.

        Raises:
            ReplayError: If it is not within 0.1 to 100.
        """
        if not SLOWEST <= speed <= FASTEST:
            raise ReplayError(codes.REPLAY_SPEED(speed=speed, least=SLOWEST, most=FASTEST))
        self._begin(self.position_s(now_s), now_s)
        self.speed = speed

    def _begin(self, position_s: float, now_s: float) -> None:
        self.begun_s, self.now_s = position_s, now_s
