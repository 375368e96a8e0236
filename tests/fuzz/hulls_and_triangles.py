"""Hulls against meshes: does a hull miss a collision that the meshes show?

    python -m tests.fuzz.hulls_and_triangles [--poses N] [--seed N] [--robots pt600,puma560,ur5]

Random positions within limits and constraints, of each arm without and with fixtures. A pair of links, or a
link and a fixture, whose meshes touch and whose hulls do not ends the run with exit status 1.
"""

import argparse
import sys
from dataclasses import dataclass, replace

import numpy as np

from robots.collision import Cell, allowed_positions, build_cell, outside_nearest, own_contacts
from robots.descriptions.cells import CellDescription, CellRobot, Fixture
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import Shape
from robots.kinematics.views import reach
from robots.shapes.geometry import Geometry, Material, Part
from robots.shapes.solids import ball, box

Pairs = set[tuple[str, str]]


@dataclass
class Count:
    """Results of some poses; a touch is a pair in a pose.

    Attributes:
        meshes, hulls: Touches.
        missed: Touches of meshes that hulls do not show, a sentence each.
        colliding: Poses in which meshes touch, and in which hulls do.
    """

    poses: int
    meshes: int
    hulls: int
    missed: list[str]
    colliding: tuple[int, int]


def compare(robot: str, poses: int, seed: int) -> Count:
    """Compare an arm's touches by meshes with those by hulls."""
    arm = CellRobot("arm", robot, np.eye(4))
    bare = build_cell(CellDescription((arm,)))
    far = reach(bare.arms["arm"].description)
    fixtures = around(far)
    hulls = build_cell(CellDescription((arm,), fixtures))
    exact = tuple(replace(fixture, exact=True) for fixture in fixtures)
    meshes = build_cell(CellDescription((arm,), exact), exact=True)
    count = Count(poses, 0, 0, [], (0, 0))
    for positions in allowed_positions(bare.arms["arm"].joints, poses, seed):
        fine, rough = touches(meshes, positions), touches(hulls, positions)
        count.meshes += len(fine)
        count.hulls += len(rough)
        count.colliding = count.colliding[0] + bool(fine), count.colliding[1] + bool(rough)
        count.missed += [f"{pair} at {positions.tolist()}" for pair in sorted(fine - rough)]
    return count


def around(far: float) -> tuple[Fixture, ...]:
    """Return a table, a post and a ball, within an arm's reach [m]."""
    return (
        _fixture("table", box(np.array([0.3, -0.5, -0.05]) * far, np.array([0.9, 0.5, 0.0]) * far)),
        _fixture("post", box(np.array([-0.4, 0.4, 0.0]) * far, np.array([-0.3, 0.5, 1.0]) * far)),
        _fixture("ball", ball(0.15 * far, 32), np.array([0.1, -0.6, 0.5]) * far),
    )


def _fixture(name: str, solid: tuple[FloatArray, np.ndarray], at: FloatArray | None = None) -> Fixture:
    points, triangles = solid
    geometry = Geometry(parts=(Part("", Material(), points, np.zeros_like(points), triangles),))
    placement = np.eye(4)
    placement[:3, 3] = 0.0 if at is None else at
    return Fixture(name, (Shape(geometry, np.eye(4)),), placement)


def touches(cell: Cell, positions: FloatArray) -> Pairs:
    """Return all pairs that touch."""
    own = own_contacts(cell, "arm", positions)
    outside = outside_nearest(cell, "arm", positions, {}, within_m=0.0)
    return {each.pair for each in (*own, *outside)}


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robots", default="pt600,puma560,ur5")
    given = parser.parse_args()
    missed = 0
    for robot in given.robots.split(","):
        count = compare(robot, given.poses, given.seed)
        missed += len(count.missed)
        by_triangles, by_hull = count.colliding
        print(
            f"{robot}: {count.poses} poses, {by_triangles} collide as meshes, {by_hull} as hulls "
            f"({(by_hull - by_triangles) / count.poses:.2%} more); {count.meshes} pairs touch as meshes, "
            f"{count.hulls} as hulls; missed by hulls: {len(count.missed)}",
            flush=True,
        )
        for text in count.missed[:10]:
            print(f"  missed: {text}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
