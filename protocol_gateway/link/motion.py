"""Motion detection, from the controller's status or from changing positions. No I/O."""

from collections import deque
from collections.abc import Sequence

from protocol_gateway.seam import Activity
from robots.kinematics.joints import JointType

# Long enough to distinguish the slowest motion (1 % of 20 degrees a second) from a sensor's last digit.
WINDOW_S = 0.5
_SAMPLE_S = 0.1
_STILL_ROTARY = 1e-3  # rad
_STILL_PRISMATIC = 1e-4  # m


class MotionDetector:
    """Detector of motion in positions, for controllers that do not report their activity."""

    def __init__(self, joint_types: Sequence[JointType]) -> None:
        self._still = still_bands(joint_types)
        self._samples: deque[tuple[float, tuple[float, ...]]] = deque()

    def add(self, positions: tuple[float, ...], time_s: float) -> None:
        """Add positions [rad] or [m] at a monotonic time; uses at most ten a second."""
        if self._samples and time_s - self._samples[-1][0] < _SAMPLE_S:
            return
        self._samples.append((time_s, positions))
        while len(self._samples) > 2 and self._samples[1][0] <= time_s - WINDOW_S:
            self._samples.popleft()

    def forget(self) -> None:
        """Drop all positions, because the next ones do not continue them."""
        self._samples.clear()

    @property
    def moving(self) -> bool | None:
        """True if the robot moved within the last half second; None: too few positions."""
        return None if len(self._samples) < 2 else self.moved_since(float("-inf"))

    def moved_since(self, time_s: float) -> bool:
        """Return whether the robot moved after a monotonic time, within the last half second."""
        return any(
            abs(there - here) > still
            for sampled_s, sample in self._samples
            if sampled_s >= time_s
            for there, here, still in zip(sample, self._samples[-1][1], self._still, strict=True)
        )


def still_bands(joint_types: Sequence[JointType]) -> tuple[float, ...]:
    """Return the greatest change of each joint that is no motion [rad] or [m]."""
    return tuple(_STILL_PRISMATIC if each is JointType.PRISMATIC else _STILL_ROTARY for each in joint_types)


def has_arrived(
    target: Sequence[float] | None, positions: Sequence[float] | None, joint_types: Sequence[JointType]
) -> bool:
    """Return whether the joints are at the target [rad] or [m]; False if either is unknown."""
    if target is None or positions is None:
        return False
    return all(
        abs(there - here) <= still
        for there, here, still in zip(target, positions, still_bands(joint_types), strict=True)
    )


def is_moving(
    activity: Activity | None, detector: MotionDetector, reported_since_s: float = 0.0
) -> bool | None:
    """Return whether the robot moves, by the controller's activity if it reports one; None: unknown.

    Args:
        reported_since_s: Time of the first report of this activity (monotonic). Positions that change after
            a while count as motion even if the controller reports rest. Those from before do not, however
            long they are the newest ones: a busy machine delivers the next ones late.
    """
    if activity is None:
        return detector.moving
    if activity in (Activity.MOVING, Activity.HOMING):
        return True
    return detector.moved_since(reported_since_s + WINDOW_S)


def motion_may_be_held(activity: Activity | None) -> bool:
    """Return whether a held motion may be waiting: the controller reports HOLDING, or no activity."""
    return activity is None or activity is Activity.HOLDING
