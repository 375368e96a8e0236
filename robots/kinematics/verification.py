"""Comparison of a model with a controller: poses of its tool beside those that the controller computes.

A controller computes its tool's Cartesian position with its own model of the arm. Where both agree in ten
poses, in which every joint moved, joint names, order, signs, zeros, scales and link lengths are right.
"""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import degrees, pi, radians

import numpy as np
from numpy.typing import NDArray

from robots.kinematics.joints import FloatArray, Joints, JointType
from robots.kinematics.kinematic_tree import Tree
from robots.schema.poses import inverse, rotation_rpy

POSES = 10
"""Poses that a comparison needs."""
TOLERANCE_M, TOLERANCE_RAD = 1e-3, radians(0.1)
"""Largest distance and angle between the two poses of the tool."""
_LEAST_TURN_RAD, _LEAST_WAY_M = radians(20.0), 0.05
_STEP = 1e-6
_STEPS = 6

_SCALES = (1.0, 0.8, 1.25, 0.5, 2.0, pi / 180)

Placement = Callable[[FloatArray], FloatArray]
"""Returns the placement of the flange, (4, 4) [m], flange to base, at joint positions [rad] or [m]."""


@dataclass(frozen=True, kw_only=True)
class Sample:
    """An arm at rest.

    Attributes:
        positions: Of the joints [rad] or [m], in the model's order.
        tool_to_base: (4, 4) [m], as the controller computes it.
        tool_to_flange: (4, 4) [m], the controller's active tool.
    """

    positions: FloatArray
    tool_to_base: FloatArray
    tool_to_flange: FloatArray


@dataclass(frozen=True)
class Deviation:
    """Distance [m] and angle [rad] of the model's tool from the controller's, in a sample."""

    sample: Sample
    distance_m: float
    angle_rad: float

    @property
    def is_small(self) -> bool:
        """True within 1 mm and 0.1°."""
        return self.distance_m <= TOLERANCE_M and self.angle_rad <= TOLERANCE_RAD


@dataclass(frozen=True, kw_only=True)
class Verification:
    """Outcome of a comparison.

    Attributes:
        deviations: One a sample.
        unmoved: Joints that moved too little to be compared, in words.
        suspects: Single changes of the model or the controller with which all poses agree, in words; empty
            if they agree, if no single change explains the deviations, or if the poses are too few.
    """

    deviations: tuple[Deviation, ...]
    unmoved: tuple[str, ...]
    suspects: tuple[str, ...]

    @property
    def agrees(self) -> bool:
        """True if the poses are enough, every joint moved, and all agree within 1 mm and 0.1°."""
        enough = len(self.deviations) >= POSES and not self.unmoved
        return enough and all(each.is_small for each in self.deviations)


def verify(placement: Placement, joints: Joints, samples: Sequence[Sample]) -> Verification:
    """Compare a model with a controller, and look for the single cause of a deviation."""
    deviations = tuple(_deviations(placement, samples))
    agree = len(samples) < POSES or all(each.is_small for each in deviations)
    return Verification(
        deviations=deviations,
        unmoved=unmoved(joints, samples),
        suspects=() if agree else tuple(_suspects(placement, joints, samples)),
    )


def joints_sha256(tree: Tree, joint_mapping: str) -> str:
    """Return the SHA-256 of everything that a verification depends on, as hexadecimal digits.

    Neither shapes nor limits change it.

    Args:
        tree: Joints and links of the model.
        joint_mapping: How the driver converts the controller's values to joints, as text.
    """
    parts = [joint_mapping]
    parts += [
        f"{each.name} {each.type} {each.parent} {each.mimic} {_digits(each.joint_to_parent)} "
        f"{_digits(each.axis)}"
        for each in tree.joints
    ]
    parts += [f"{each.name} {each.joint} {_digits(each.link_to_joint)}" for each in tree.links]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _digits(values: FloatArray) -> str:
    # Nine decimals, so that another order of operations gives the same; without a negative zero.
    return " ".join(f"{each:.9f}" for each in np.round(values.ravel(), 9) + 0.0)


def unlike(joints: Joints, positions: FloatArray, samples: Sequence[Sample]) -> bool:
    """Return whether a pose differs from all others by 10° or 25 mm in a joint."""
    least = _least_ways(joints) / 2
    return all((np.abs(positions - each.positions) >= least).any() for each in samples)


def _deviations(placement: Placement, samples: Sequence[Sample]) -> Iterator[Deviation]:
    for sample in samples:
        modelled, given = placement(sample.positions) @ sample.tool_to_flange, sample.tool_to_base
        turned = modelled[:3, :3].T @ given[:3, :3]
        # By the sine, which is exact for small angles.
        twice = turned[[2, 0, 1], [1, 2, 0]] - turned[[1, 2, 0], [2, 0, 1]]
        angle = np.arctan2(np.linalg.norm(twice), np.trace(turned) - 1.0)
        yield Deviation(sample, float(np.linalg.norm(modelled[:3, 3] - given[:3, 3])), float(angle))


def _least_ways(joints: Joints) -> FloatArray:
    rotary = [each is JointType.ROTARY for each in joints.types]
    return np.where(rotary, _LEAST_TURN_RAD, _LEAST_WAY_M)


def unmoved(joints: Joints, samples: Sequence[Sample]) -> tuple[str, ...]:
    """Return the joints that moved too little to be compared, in words."""
    if not samples:
        return ()
    moved = np.ptp([each.positions for each in samples], axis=0)
    rows = zip(joints.names, joints.types, moved, _least_ways(joints), strict=True)
    return tuple(
        f"{name} moved by {_way(way, kind)} in all poses; {_way(least, kind)} is needed"
        for name, kind, way, least in rows
        if way < least
    )


def _way(value: float, kind: JointType) -> str:
    return f"{degrees(value):.1f}°" if kind is JointType.ROTARY else f"{1000 * value:.1f} mm"


# ------------------------------------------------------------------ suspected causes


def _suspects(placement: Placement, joints: Joints, samples: Sequence[Sample]) -> Iterator[str]:
    yield from _of_frames(placement, samples)
    for index, (name, kind) in enumerate(zip(joints.names, joints.types, strict=True)):
        yield from _of_joint(placement, samples, index, name, kind)
        if index:
            yield from _of_coupling(placement, samples, index, joints.names)
    for one in range(len(joints.names) - 1):
        order = np.arange(len(joints.names))
        order[[one, one + 1]] = one + 1, one
        if _agree(partial(_in_order, placement, order), samples):
            yield f"{joints.names[one]} and {joints.names[one + 1]} are exchanged"


def _in_order(placement: Placement, order: NDArray[np.intp], positions: FloatArray) -> FloatArray:
    return placement(positions[order])


def _of_frames(placement: Placement, samples: Sequence[Sample]) -> Iterator[str]:
    """Yield a constant transform at the base or the flange, or another unit of length."""
    flanges = [placement(each.positions) for each in samples]
    given = [each.tool_to_base @ inverse(each.tool_to_flange) for each in samples]
    base = _mean([there @ inverse(here) for here, there in zip(flanges, given, strict=True)])
    if _agree(lambda positions: base @ placement(positions), samples):
        yield f"the controller's base is another one: the model's is at {_pose(base)} in it"
    flange = _mean([inverse(here) @ there for here, there in zip(flanges, given, strict=True)])
    if _agree(lambda positions: placement(positions) @ flange, samples):
        yield f"the controller's flange is another one: it is at {_pose(flange)} in the model's"
    for factor in (1e-3, 1e3):
        scaled = [
            Sample(
                positions=each.positions,
                tool_to_base=_scaled(each.tool_to_base, factor),
                tool_to_flange=_scaled(each.tool_to_flange, factor),
            )
            for each in samples
        ]
        if _agree(placement, scaled):
            yield f"the controller's lengths are {1 / factor:g} times the model's: another unit"


def _of_joint(
    placement: Placement, samples: Sequence[Sample], index: int, name: str, kind: JointType
) -> Iterator[str]:
    """Yield an error of one joint's sign, zero or scale."""

    def changed(scale: float, offset: float) -> Placement:
        return _with_joint(placement, index, lambda positions: scale * positions[index] + offset)

    if _agree(changed(-1.0, 0.0), samples):
        yield f"{name} turns the other way" if kind is JointType.ROTARY else f"{name} moves the other way"
        return
    for sign, words in ((1.0, ""), (-1.0, " and it turns the other way")):
        offset = _offset(partial(changed, sign), samples, kind)
        if _agree(changed(sign, offset), samples):
            yield f"the zero of {name} is off by {_way(offset, kind)}{words}"
            return
    for start in _SCALES:
        scale = _scale(lambda scale: changed(scale, 0.0), samples, start)
        if _agree(changed(scale, 0.0), samples):
            yield f"{name} moves {scale:.4g} times as far as its value says"
            return


def _of_coupling(
    placement: Placement, samples: Sequence[Sample], index: int, names: Sequence[str]
) -> Iterator[str]:
    """Yield a joint with a value that contains that of the joint before, as J3 of some arms contains J2."""
    for sign, words in ((1.0, "plus"), (-1.0, "minus")):

        def coupled(positions: FloatArray, sign: float = sign) -> float:
            return float(positions[index] + sign * positions[index - 1])

        if _agree(_with_joint(placement, index, coupled), samples):
            yield f"{names[index]} is its value {words} that of {names[index - 1]}"


def _with_joint(placement: Placement, index: int, value: Callable[[FloatArray], float]) -> Placement:
    """Return a placement that gives a joint another value than the controller's."""

    def place(positions: FloatArray) -> FloatArray:
        other = positions.copy()
        other[index] = value(positions)
        return placement(other)

    return place


def _agree(placement: Placement, samples: Sequence[Sample]) -> bool:
    return all(each.is_small for each in _deviations(placement, samples))


def _offset(changed: Callable[[float], Placement], samples: Sequence[Sample], kind: JointType) -> float:
    """Return the offset of one joint with the least errors.

    Each element of a placement is a + b cos q + c sin q of a rotary joint's q, and a + b q of a prismatic
    one's, so that three errors give it.
    """
    if kind is JointType.PRISMATIC:
        here = _errors(changed(0.0), samples)
        slope = _errors(changed(1.0), samples) - here
        return -float(slope @ here) / max(float(slope @ slope), _STEP)
    turns = np.array([0.0, 2 * pi / 3, 4 * pi / 3])
    errors = np.array([_errors(changed(turn), samples) for turn in turns])
    a = errors.mean(axis=0)
    b, c = (2 / 3 * (np.array([each(turn) for turn in turns]) @ errors) for each in (np.cos, np.sin))
    cos, sin = np.linalg.lstsq(np.stack([b, c], axis=1), -a, rcond=None)[0]
    return float(np.arctan2(sin, cos))


def _scale(changed: Callable[[float], Placement], samples: Sequence[Sample], scale: float) -> float:
    """Return the scale of one joint with the least errors near a first value, by Newton's method."""
    for _ in range(_STEPS):
        errors = _errors(changed(scale), samples)
        slope = (_errors(changed(scale + _STEP), samples) - errors) / _STEP
        step = float(slope @ errors) / max(float(slope @ slope), _STEP)
        scale -= step
        if abs(step) < _STEP:
            break
    return scale


def _errors(placement: Placement, samples: Sequence[Sample]) -> FloatArray:
    """Return the errors of all elements of all placements; a metre counts as a radian."""
    return np.concatenate(
        [
            (placement(each.positions) @ each.tool_to_flange - each.tool_to_base)[:3].ravel()
            for each in samples
        ]
    )


def _mean(transforms: Sequence[FloatArray]) -> FloatArray:
    """Return the mean of transforms, (4, 4)."""
    mean = np.mean(transforms, axis=0)
    u, _, v = np.linalg.svd(mean[:3, :3])
    mean[:3, :3] = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    return np.asarray(mean)


def _scaled(transform: FloatArray, factor: float) -> FloatArray:
    scaled = transform.copy()
    scaled[:3, 3] *= factor
    return scaled


def _pose(transform: FloatArray) -> str:
    turned = [degrees(each) for each in rotation_rpy(transform[:3, :3])]
    # Without a negative zero.
    x, y, z, roll, pitch, yaw = np.round([*(1000 * transform[:3, 3]), *turned], 1) + 0.0
    return f"x {x:.1f} y {y:.1f} z {z:.1f} mm, roll {roll:.1f} pitch {pitch:.1f} yaw {yaw:.1f}°"
