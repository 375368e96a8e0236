"""Thinning of a resting arm's joint states. No I/O; time is an argument.

published    while
---------    -----------------------------------------------------------------------------------------
every unit   the arm moves, or a motion, program or jog is under way; a joint is outside the band around its
             last published value, from that unit on; and for `SETTLED_S` after each of these
some         otherwise: one about every 0.1 s, or five within the stale time if that is more often
"""

from collections.abc import Sequence

from protocol_gateway.link.motion import still_bands
from robots.kinematics.joints import JointType

SETTLED_S = 0.5
LONGEST_S = 0.1
# Share of what counts as motion that is at rest: the last digits of an encoder.
_BAND = 0.1


class Thinning:
    """Choice of the positions that are published.

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
            rests: The arm does not move, and nothing that moves it is under way.
        """
        published = self._published
        if not rests or published is None or self._left_band(positions, published):
            self._restless_s = time_s
        if time_s - self._restless_s >= SETTLED_S and time_s < self._next_s:
            self.thinned += 1
            return False
        # All arms publish at the same times: states that arrive together wake a receiver once.
        self._next_s = (int(time_s / self._longest_s + 1e-6) + 1) * self._longest_s
        self._published = positions
        return True

    def _left_band(self, positions: tuple[float, ...], published: tuple[float, ...]) -> bool:
        for there, here, band in zip(positions, published, self._bands, strict=True):
            if not -band <= there - here <= band:
                return True
        return False
