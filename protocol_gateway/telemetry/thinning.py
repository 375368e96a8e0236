"""Thinning of a resting arm's joint states. No I/O; time is an argument.

published    while
---------    -----------------------------------------------------------------------------------------
every unit   the arm moves, or something was commanded; a joint has left the band around the value that
             was published last, from that unit on; and for `SETTLED_S` after each of these
some         otherwise: at least every `longest_s`
"""

from collections.abc import Sequence

from protocol_gateway.link.motion import still_bands
from robots.kinematics.joints import JointType

SETTLED_S = 0.5
LONGEST_S = 0.1
# Share of what counts as motion that is at rest: the last digits of an encoder.
_BAND = 0.1


class Thinning:
    """Decision which positions are published.

    Attributes:
        thinned: Number of positions that were not published.

    Args:
        stale_after_s: Age at which positions are stale [s].
    """

    def __init__(self, joint_types: Sequence[JointType], stale_after_s: float) -> None:
        self._bands = tuple(_BAND * each for each in still_bands(joint_types))
        self._longest_s = min(LONGEST_S, stale_after_s / 5.0)
        self.thinned = 0
        self.forget()

    def forget(self) -> None:
        """Publish the next positions: they do not continue the last ones."""
        self._published: tuple[float, ...] | None = None
        self._restless_s = self._next_s = float("-inf")

    def publishes(self, positions: tuple[float, ...], time_s: float, *, rests: bool) -> bool:
        """Return whether positions [rad] or [m] of a monotonic time are published.

        Args:
            rests: The arm does not move and will not: nothing is under way.
        """
        published = self._published
        if not rests or published is None or self._left_band(positions, published):
            self._restless_s = time_s
        if time_s - self._restless_s >= SETTLED_S and time_s < self._next_s:
            self.thinned += 1
            return False
        # Of all arms at the same times: what receives several is woken once for those that arrive together.
        self._next_s = (int(time_s / self._longest_s + 1e-6) + 1) * self._longest_s
        self._published = positions
        return True

    def _left_band(self, positions: tuple[float, ...], published: tuple[float, ...]) -> bool:
        for there, here, band in zip(positions, published, self._bands, strict=True):
            if not -band <= there - here <= band:
                return True
        return False
