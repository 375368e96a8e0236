"""Built-in motion: an endless tour of poses for any described arm.

Candidate poses are spread evenly over the joints' ranges around home. A pose is used if the whole arm stays
well above the floor on the way to it, and if it is far from the poses before, so that every leg of the tour
is a wide sweep. The tour is deterministic.
"""

import itertools
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from robots.descriptions.description import RobotDescription
from robots.kinematics.joints import FloatArray, Joints, joints_of, violations
from robots.kinematics.motion import ArmState, Motion

_Reachable: TypeAlias = Callable[[FloatArray, FloatArray], bool]

_REST_S = 0.4
_POSES = 8
_CANDIDATES = 240
# Fraction of the way from home to each limit; a demonstration stays away from limits.
_REACH = 0.62
# Lowest height of the tool and of the links after the first two, as a fraction of the arm's greatest height.
_FLOOR = 0.22
_STEPS = 12
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37)


class DemoProgram:
    """Program that moves an arm along a tour, with a pause at each pose. No I/O; time is an argument.

    Args:
        tour: Targets (n,) [rad] or [m]; None: no program, at rest.
        speed: Fraction of the joints' speeds.
        start: Positions (n,) [rad] or [m] at which it begins; None: home.

    Attributes:
        speed: The next motions have it.
        leg: Number of motions so far.
        stopped: The program waits at the place where the arm was stopped.
    """

    def __init__(
        self,
        joints: Joints,
        tour: Iterator[FloatArray] | None,
        *,
        speed: float,
        start: FloatArray | None = None,
    ) -> None:
        self._motion = Motion(joints, joints.home.copy() if start is None else start)
        self._tour = tour
        self._target: FloatArray | None = None
        self.speed = speed
        self.leg = 0
        self.stopped = False

    @property
    def runs(self) -> bool:
        """True if there is a program that is not stopped."""
        return self._tour is not None and not self.stopped

    def tick(self, now_s: float) -> None:
        """Begin the next motion if the current one has ended."""
        if self._tour is None or self.stopped or self._motion.moving(now_s):
            return
        if self._target is None or now_s >= self._motion.end_s + _REST_S:
            self._target = next(self._tour)
            self.leg += 1
            self._move(now_s)

    def stop(self, now_s: float) -> None:
        """Brake, and wait."""
        self.stopped = True
        self._motion.brake(now_s)

    def go_on(self, now_s: float) -> None:
        """End the wait."""
        self.stopped = False
        if self._target is not None:
            self._move(now_s)

    def set_speed(self, speed: float, now_s: float) -> None:
        """Change the speed, also of the current motion."""
        self.speed = speed
        if self._motion.moving(now_s) and not self.stopped:
            self._move(now_s)

    def moving(self, now_s: float) -> bool:
        """Return whether the arm moves."""
        return self._motion.moving(now_s)

    def state(self, now_s: float) -> ArmState:
        """Return positions, velocities and accelerations."""
        return self._motion.state(now_s)

    def _move(self, now_s: float) -> None:
        assert self._target is not None
        self._motion.move(self._target, now_s, speed=self.speed)


def demo_tour(description: RobotDescription) -> Iterator[FloatArray]:
    """Return an endless iterator of targets (n,) [rad] or [m]; the tour begins and ends at home."""
    from robots.kinematics.model import (  # takes 0.4 s, only for a demo
        build_model,
        link_placements,
        tool_placement,
    )

    joints = joints_of(description)
    model = build_model(description)

    def height(positions: FloatArray) -> float:
        links = link_placements(model, positions)[2:, 2, 3]
        return float(min(links.min(initial=np.inf), tool_placement(model, positions)[2, 3]))

    candidates = _candidates(joints)
    # A flat arm at home is never above the floor there, so it may stay as low as at home.
    floor = min(_FLOOR * max([height(joints.home), *map(height, candidates)]), height(joints.home))

    def reachable(begin: FloatArray, end: FloatArray) -> bool:
        path = np.linspace(begin, end, _STEPS)
        return all(height(pose) >= floor and not violations(joints, pose) for pose in path)

    tour = [joints.home]
    ranges = joints.upper - joints.lower
    for _ in range(_POSES):
        poses = np.array(tour)
        # Distance from every pose so far, in fractions of each joint's range.
        spread = [float(np.abs((poses - pose) / ranges).sum(axis=1).min()) for pose in candidates]
        order = np.argsort(spread)[::-1]
        found = next((candidates[i] for i in order if reachable(tour[-1], candidates[i])), None)
        if found is None:
            break
        tour.append(found)
    return itertools.cycle([*tour[1:], *_way_home(tour, reachable)])


def _way_home(tour: list[FloatArray], reachable: _Reachable) -> list[FloatArray]:
    """Return the poses back to home, over earlier poses of the tour if the direct way is blocked."""
    for index in range(len(tour) - 1, -1, -1):
        if reachable(tour[index], tour[0]):
            return [*reversed(tour[index:-1]), tour[0]]
    return tour[-2::-1]


def _candidates(joints: Joints) -> list[FloatArray]:
    """Return poses around home, evenly spread by a Halton sequence."""
    lower = joints.home + (joints.lower - joints.home) * _REACH
    upper = joints.home + (joints.upper - joints.home) * _REACH
    bases = [_PRIMES[i % len(_PRIMES)] for i in range(len(joints))]
    return [
        lower + (upper - lower) * np.array([_radical_inverse(n, base) for base in bases])
        for n in range(1, _CANDIDATES + 1)
    ]


def _radical_inverse(number: int, base: int) -> float:
    """Return the number's digits mirrored at the radix point, a value of an even spread over 0 to 1."""
    value, place = 0.0, 1.0 / base
    while number:
        number, digit = divmod(number, base)
        value += digit * place
        place /= base
    return value
