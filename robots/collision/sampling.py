"""Which links touch which, found by trying: what a description may leave out of its collision checks.

Links count as the convex hulls of what is checked of them; "always" holds for their meshes, too.
"""

from dataclasses import dataclass
from enum import StrEnum
from itertools import combinations
from typing import Any

import coal
import numpy as np

from robots.collision.bodies import hull_bodies, surface, transform
from robots.collision.surfaces import Surface, Touch
from robots.errors import DescriptionError
from robots.joints import FloatArray, Joints, constraint_values
from robots.model import RobotModel, build_model, link_placements
from robots.schema import RobotDescription
from robots.tree import BASE, Tree, tree_of

# A pair that touches in a thousandth of all positions is missed once in 22,000 times.
SAMPLES = 10_000
# Fewer positions say neither never nor always.
FEWEST = 1_000
# Walks among coupled limits: rounds of so many steps a joint, each round after the shape that the last found.
_ROUNDS, _STEPS_A_JOINT = 4, 12


class Contact(StrEnum):
    """How often two links touch: one joint apart, in all positions, in none, in some."""

    ADJACENT = "adjacent"
    ALWAYS = "always"
    NEVER = "never"
    SOMETIMES = "sometimes"


@dataclass(frozen=True)
class LinkPair:
    """Two links, and how often they touch.

    Attributes:
        share: Of the sampled positions in which they touch, 0 to 1.
    """

    links: tuple[str, str]
    contact: Contact
    share: float


@dataclass(frozen=True)
class Sampling:
    """What came of trying.

    Attributes:
        tried: Positions, home among them.
    """

    tried: int
    pairs: tuple[LinkPair, ...]


def sample_pairs(description: RobotDescription, *, samples: int = SAMPLES, seed: int = 0) -> Sampling:
    """How often each two links touch, over random positions within limits and constraints; home is one.

    Args:
        samples: Positions to try, at least FEWEST; the same seed tries the same ones.

    Raises:
        DescriptionError: If the constraints leave fewer positions to try than say anything.
        MeshError: If a link's mesh cannot be read.
    """
    tree, model = tree_of(description), build_model(description)
    hulls = {link.name: body.geometry for link in tree.links for body in hull_bodies(link.checked)}
    joints = {link.name: link.joint for link in tree.links}
    neighbours = {
        pair for pair in combinations(hulls, 2) if are_neighbours(tree, *(joints[name] for name in pair))
    }
    numbers = {name: model.link_names.index(name) for name in hulls}
    pairs = list(combinations(hulls, 2))
    touched = np.zeros(len(pairs), dtype=np.int64)
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    all_positions = allowed_positions(model.joints, samples, seed)
    tried = len(all_positions)
    if tried < FEWEST:
        text = f"the constraints leave {tried} positions to try: too few to say which links never touch"
        raise DescriptionError(description.source, [text], paths=[("constraint",)])
    for positions in all_positions:
        placements = link_placements(model, positions)
        at = {name: transform(placements[number]) for name, number in numbers.items()}
        for index, (one, other) in enumerate(pairs):
            result.clear()
            touched[index] += coal.collide(hulls[one], at[one], hulls[other], at[other], request, result) > 0
    _confirm_always(tree, model, all_positions, pairs, touched)
    return Sampling(
        tried,
        tuple(
            LinkPair(pair, _contact(count, tried, adjacent=pair in neighbours), count / tried)
            for pair, count in zip(pairs, touched.tolist(), strict=True)
        ),
    )


def _confirm_always(
    tree: Tree, model: RobotModel, positions: FloatArray, pairs: list[tuple[str, str]], touched: Any
) -> None:
    """Take one off the count of a pair whose hulls touch in all positions and whose meshes do not."""
    links = {link.name: link for link in tree.links}
    touch = Touch()
    for index in np.flatnonzero(touched == len(positions)).tolist():
        surfaces = [Surface(surface(links[name].checked)) for name in pairs[index]]
        if not all(len(each.triangles) for each in surfaces):
            continue
        numbers = [model.link_names.index(name) for name in pairs[index]]
        for each in positions:
            one_at, other_at = link_placements(model, each)[numbers]
            if not touch(surfaces[0], surfaces[1], np.linalg.solve(one_at, other_at)):
                touched[index] -= 1
                break


def _contact(touched: int, tried: int, *, adjacent: bool) -> Contact:
    if adjacent:
        return Contact.ADJACENT
    if touched == 0:
        return Contact.NEVER
    return Contact.ALWAYS if touched == tried else Contact.SOMETIMES


def are_neighbours(tree: Tree, one: int, other: int) -> bool:
    """Whether links on these joints are on the same one, or one joint apart."""
    return one == other or any(
        joint != BASE and tree.joints[joint].parent == parent
        for joint, parent in ((one, other), (other, one))
    )


def allowed_positions(joints: Joints, samples: int, seed: int = 0) -> FloatArray:
    """Home, then random joint positions that every limit allows, evenly spread: (count, n) [rad] or [m].

    Fewer than asked for only where the constraints hold the robot at home.

    Coupled limits make the box of the limits a polytope, which may be as thin as one likes. Each position
    is the end of a walk of its own from home: a random direction, a random point of the line within the
    polytope, and so on. Directions are stretched as the polytope is (Dikin's ellipsoid about the mean of
    all walks so far), so that a thin one is walked along as fast as any.

    Source: Smith 1984 (hit and run); Kannan, Narayanan 2012 (Dikin walks).
    """
    random = np.random.default_rng(seed)
    size = joints.upper - joints.lower
    if not joints.constraints:
        others = random.uniform(joints.lower, joints.upper, (samples - 1, len(joints)))
        return np.vstack([joints.home, others])
    # In units of each joint's range. Walls: normal . position <= height.
    sums = np.array([constraint.coefficients * size for constraint in joints.constraints])
    one = np.eye(len(joints))
    normals = np.concatenate([one, -one, sums, -sums])
    origin = constraint_values(joints, joints.lower)
    upper = np.array([constraint.upper for constraint in joints.constraints]) - origin
    lower = np.array([constraint.lower for constraint in joints.constraints]) - origin
    heights = np.concatenate([np.ones(len(joints)), np.zeros(len(joints)), upper, -lower])
    positions = np.tile((joints.home - joints.lower) / size, (samples - 1, 1))
    stretch = one
    for _ in range(_ROUNDS):
        for _ in range(_STEPS_A_JOINT * len(joints)):
            positions = _step(positions, normals, heights, stretch, random)
        slack = heights - normals @ positions.mean(axis=0)
        if (slack <= 0).any():
            return joints.home[None]
        _, thinness, axes = np.linalg.svd(normals / slack[:, None], full_matrices=False)
        stretch = axes.T / thinness
    return np.vstack([joints.home, joints.lower + positions * size])


def _step(
    positions: FloatArray,
    normals: FloatArray,
    heights: FloatArray,
    stretch: FloatArray,
    random: np.random.Generator,
) -> FloatArray:
    """Each position (count, n) moved to a random point of a line through it, within all walls."""
    directions = random.standard_normal(positions.shape) @ stretch.T
    towards = directions @ normals.T
    slack = np.maximum(heights - positions @ normals.T, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = slack / towards
    ahead = np.where(towards > 0, reach, np.inf).min(axis=1)
    behind = np.where(towards < 0, reach, -np.inf).max(axis=1)
    moved: FloatArray = positions + random.uniform(behind, ahead)[:, None] * directions
    return moved
