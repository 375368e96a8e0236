"""The built-in motion: an endless tour of poses that any described arm can show.

Poses are spread evenly over the joints' ranges around home, kept when the whole arm stays well above
the floor on the way to them, and chosen each as far as possible from those before, so that every
leg of the tour is a wide sweep. Nothing is random: the same arm always dances the same dance.
"""

import itertools
from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np

from robots.description import RobotDescription
from robots.joints import FloatArray, Joints, joints_of, violations

_Reachable: TypeAlias = Callable[[FloatArray, FloatArray], bool]

_POSES = 8
_CANDIDATES = 240
# Of the way from home to each limit: a demonstration has no business near a limit.
_REACH = 0.62
# Lowest height of the tool and of the links beyond the first two, as a part of the arm's greatest height.
_FLOOR = 0.22
_STEPS = 12
_PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37)


def demo_tour(description: RobotDescription) -> Iterator[FloatArray]:
    """Targets (n,) [rad] or [m], for ever; it begins and comes round at home."""
    from robots.model import build_model, link_placements, tool_placement  # 0.4 s that only a demo pays

    joints = joints_of(description)
    model = build_model(description)

    def height(positions: FloatArray) -> float:
        links = link_placements(model, positions)[2:, 2, 3]
        return float(min(links.min(initial=np.inf), tool_placement(model, positions)[2, 3]))

    candidates = _candidates(joints)
    floor = _FLOOR * max([height(joints.home), *map(height, candidates)])

    def reachable(begin: FloatArray, end: FloatArray) -> bool:
        path = np.linspace(begin, end, _STEPS)
        return all(height(pose) >= floor and not violations(joints, pose) for pose in path)

    tour = [joints.home]
    ranges = joints.upper - joints.lower
    for _ in range(_POSES):
        poses = np.array(tour)
        # Farthest from every pose so far, measured in parts of each joint's range.
        spread = [float(np.abs((poses - pose) / ranges).sum(axis=1).min()) for pose in candidates]
        order = np.argsort(spread)[::-1]
        found = next((candidates[i] for i in order if reachable(tour[-1], candidates[i])), None)
        if found is None:
            break
        tour.append(found)
    return itertools.cycle([*tour[1:], *_way_home(tour, reachable)])


def _way_home(tour: list[FloatArray], reachable: _Reachable) -> list[FloatArray]:
    """Home, and back over the poses that have been shown where the straight way is not free."""
    for index in range(len(tour) - 1, -1, -1):
        if reachable(tour[index], tour[0]):
            return [*reversed(tour[index:-1]), tour[0]]
    return tour[-2::-1]


def _candidates(joints: Joints) -> list[FloatArray]:
    """Poses around home, evenly spread by a Halton sequence."""
    lower = joints.home + (joints.lower - joints.home) * _REACH
    upper = joints.home + (joints.upper - joints.home) * _REACH
    bases = [_PRIMES[i % len(_PRIMES)] for i in range(len(joints))]
    return [
        lower + (upper - lower) * np.array([_radical_inverse(n, base) for base in bases])
        for n in range(1, _CANDIDATES + 1)
    ]


def _radical_inverse(number: int, base: int) -> float:
    """The digits of a number mirrored behind the point: evenly spread over 0 to 1."""
    value, place = 0.0, 1.0 / base
    while number:
        number, digit = divmod(number, base)
        value += digit * place
        place /= base
    return value
