"""Whether a robot moves: told by its controller, or seen from its positions. No I/O."""

from collections import deque
from collections.abc import Sequence

from protocol_gateway.drivers.driver import Activity
from robots.joints import JointType

# A window long enough to tell the slowest motion (1 % of 20 degrees a second) from a sensor's last digit.
WINDOW_S = 0.5
_SAMPLE_S = 0.1
# Longer than the window: what is left in it of the motion before is no motion.
_SETTLED_S = 2 * WINDOW_S
_STILL_ROTARY = 1e-3  # rad
_STILL_PRISMATIC = 1e-4  # m


class MotionDetector:
    """Sees motion in positions, for controllers that do not tell their activity."""

    def __init__(self, joint_types: Sequence[JointType]) -> None:
        self._still = _still(joint_types)
        self._samples: deque[tuple[float, tuple[float, ...]]] = deque()

    def add(self, positions: tuple[float, ...], time_s: float) -> None:
        """Take note of positions [rad] or [m] at a monotonic time; more than ten a second are passed over."""
        if self._samples and time_s - self._samples[-1][0] < _SAMPLE_S:
            return
        self._samples.append((time_s, positions))
        while len(self._samples) > 2 and self._samples[1][0] <= time_s - WINDOW_S:
            self._samples.popleft()

    def forget(self) -> None:
        """The link was lost: what comes next is no continuation."""
        self._samples.clear()

    @property
    def moving(self) -> bool | None:
        """Whether it moved within the last half second; None: too little was seen."""
        if len(self._samples) < 2:
            return None
        last = self._samples[-1][1]
        return any(
            abs(there - here) > still
            for _, sample in self._samples
            for there, here, still in zip(sample, last, self._still, strict=True)
        )


def _still(joint_types: Sequence[JointType]) -> tuple[float, ...]:
    return tuple(_STILL_PRISMATIC if each is JointType.PRISMATIC else _STILL_ROTARY for each in joint_types)


def has_arrived(
    target: Sequence[float] | None, positions: Sequence[float] | None, joint_types: Sequence[JointType]
) -> bool:
    """Whether the joints are where they were to go [rad] or [m]; where one of both is not known: no."""
    if target is None or positions is None:
        return False
    return all(
        abs(there - here) <= still
        for there, here, still in zip(target, positions, _still(joint_types), strict=True)
    )


def is_moving(
    activity: Activity | None, detector: MotionDetector, reported_for_s: float = 0.0
) -> bool | None:
    """Whether the robot moves: the controller's word where it gives one; None: not known.

    Args:
        reported_for_s: How long the controller has said so. An arm that has been at rest for a while by its
            controller's word, and whose positions change, moves all the same.
    """
    if activity is None:
        return detector.moving
    if activity in (Activity.MOVING, Activity.HOMING):
        return True
    return reported_for_s >= _SETTLED_S and bool(detector.moving)


def motion_may_be_held(activity: Activity | None) -> bool:
    """Whether a held motion may be waiting: the controller says that it holds, or does not say."""
    return activity is None or activity is Activity.HOLDING
