"""Proof that an arm is at rest after a stop."""

from collections.abc import Collection, Sequence

from protocol_gateway.seam.events import Activity

STILL_S = 0.5
"""Time for which every joint must be still."""


class Rest:
    """Stillness of the joints; a driver reports a moving arm after a stop until it is proven.

    A controller may say "idle" while the arm still brakes, or before a motion begins that was sent late.

    Attributes:
        positions: The newest ones, one a joint [rad] or [m]; None: unknown.
        positions_s: Time of the newest ones [s].
        since_s: Time since which every joint is still [s]; None: unknown.
    """

    def __init__(
        self, still_within: Sequence[float], at_rest: Collection[Activity] = (Activity.IDLE,)
    ) -> None:
        """Begin with an arm at rest, at unknown positions.

        Args:
            still_within: Largest distance of a joint that counts as still, one a joint [rad] or [m].
            at_rest: What the controller may say of an arm that still moves.
        """
        self._still_within, self._at_rest = still_within, at_rest
        self._still_at: Sequence[float] = ()
        self._proven = True
        self.forget()

    def forget(self) -> None:
        """Forget the positions, because the connection that reports them was lost."""
        self.positions: tuple[float, ...] | None = None
        self.positions_s = float("-inf")
        self.since_s: float | None = None

    def at(self, positions: tuple[float, ...], now_s: float) -> None:
        """Note where the arm is, with one position a joint [rad] or [m]."""
        self.positions, self.positions_s = positions, now_s
        if self.since_s is None or not near(positions, self._still_at, self._still_within):
            self._still_at, self.since_s = positions, now_s

    def near(self, there: Sequence[float]) -> bool:
        """Return whether the arm is where it was; False: it has moved, or that is unknown."""
        return self.positions is not None and near(self.positions, there, self._still_within)

    def prove_again(self, *, moved: bool = True) -> None:
        """Report a moving arm until its rest is proven, because a motion was stopped.

        Args:
            moved: The arm may have moved since its newest positions, so only later ones are a proof.
        """
        self._proven = False
        if moved:
            self.since_s = None

    def reported(self, activity: Activity | None, until_s: float, *, runs: bool = False) -> Activity | None:
        """Return the activity to report for one that the controller says.

        Args:
            until_s: Time up to which the arm is known to be still, if it has not moved [s].
            runs: A motion is open, so the arm is not idle.
        """
        if activity in (None, Activity.MOVING):
            return activity
        if runs and activity is Activity.IDLE:
            return Activity.MOVING
        self._proven |= self.since_s is not None and until_s - self.since_s >= STILL_S
        return activity if self._proven or activity not in self._at_rest else Activity.MOVING


def near(here: Sequence[float], there: Sequence[float], within: Sequence[float]) -> bool:
    """Return whether all joints are near others, each within its distance."""
    return all(abs(a - b) <= most for a, b, most in zip(here, there, within, strict=True))
