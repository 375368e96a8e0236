"""A cell: arms that are checked against each other, and fixtures that stand around them.

`build_cell` reads the files that a `robots.cells.CellDescription` names.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robots.cells import FLOOR, CellDescription, CellRobot, Fixture, Floor
from robots.collision.geometry import Body, exact_bodies, hull_bodies, piece_bodies
from robots.collision.link_pairs import PairPlan, plan_pairs
from robots.collision.obstacles import Balls, Obstacles, balls_of, joined
from robots.collision.self_collision import OwnPairs, own_pairs
from robots.description import load
from robots.errors import MeshError
from robots.joints import FloatArray, Joints
from robots.kinematic_tree import BASE, Tree, bare_links, tree_of
from robots.model import RobotModel, build_model
from robots.schema import RobotDescription, UrdfDescription, nearest


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm that can be checked.

    Attributes:
        base_to_site: (4, 4) [m].
        bodies: What it is made of, each in the frame of its link.
        names: Of each body's link: "<robot>/<link>".
        links: (b,) number of each body's link among the model's.
        moving: (b,) whether a joint moves the body.
        balls: They cover the bodies.
        plan: How it is checked against itself.
    """

    name: str
    model: RobotModel
    description: RobotDescription
    tree: Tree
    joints: Joints
    base_to_site: FloatArray
    warning_m: float
    stop_m: float
    bodies: tuple[Body, ...]
    names: tuple[str, ...]
    links: NDArray[np.int64]
    moving: NDArray[np.bool_]
    balls: Balls
    own: OwnPairs
    plan: PairPlan


@dataclass(frozen=True, eq=False)
class Cell:
    """A cell that can be checked. One thread at a time: workspaces are reused by each call.

    Attributes:
        arms: By name.
        fixtures: What stands around them.
        floor: With its height; None: there is none.
        ignored: Link and fixture that may touch, as `Nearest` names them.
    """

    arms: Mapping[str, Arm]
    fixtures: Obstacles
    floor: Floor | None
    ignored: frozenset[tuple[str, str]]


def build_cell(description: CellDescription, *, exact: bool = False, wait: bool = True) -> Cell:
    """Read what a cell's checks need.

    Args:
        exact: Check links as their meshes, not as hulls about them: distances are some hundred times slower.
        wait: Wait for studies of links whose hulls touch; else they go on, and the cell is `pending`.

    Raises:
        DescriptionError: If a robot's description cannot be used.
        MeshError: If a mesh cannot be read, or a fixture has no surface.
    """
    arms = {robot.name: _arm(robot, exact=exact, wait=wait) for robot in description.robots}
    links = {f"{arm.name}/{link}" for arm in arms.values() for link in arm.model.link_names}
    return Cell(
        arms,
        joined([_standing(fixture, links) for fixture in description.fixtures]),
        description.floor and replace(description.floor, height_m=description.floor_m),
        frozenset((link, fixture.name) for fixture in description.fixtures for link in fixture.ignore),
    )


@lru_cache(maxsize=8)
def _read(
    model: str | Path, confined: bool, exact: bool
) -> tuple[RobotDescription, tuple[tuple[int, Body], ...]]:
    """A robot's description, and its links' bodies: a plant has many arms of one kind."""
    description = load(model, confined=confined)
    bodies_of = exact_bodies if exact else hull_bodies
    links = enumerate(tree_of(description).links)
    return description, tuple((number, body) for number, link in links for body in bodies_of(link.checked))


def _arm(robot: CellRobot, *, exact: bool, wait: bool) -> Arm:
    plan = plan_pairs(robot.model, robot.confined, wait=wait)
    description, bodies = _read(robot.model, robot.confined, exact)
    pairs = plan.pairs
    if exact:
        pairs = [(one, other, (bodies[one][1], bodies[other][1])) for one, other, _ in pairs]
    else:
        bodies = plan.bodies
    model, tree = build_model(description), tree_of(description)
    links = np.array([number for number, _ in bodies], dtype=np.int64)
    return Arm(
        name=robot.name,
        model=model,
        description=description,
        tree=tree,
        joints=model.joints,
        base_to_site=np.array(robot.base_to_site, dtype=np.float64),
        warning_m=robot.warning_m,
        stop_m=robot.stop_m,
        bodies=tuple(body for _, body in bodies),
        names=tuple(f"{robot.name}/{tree.links[number].name}" for number in links),
        links=links,
        moving=np.array([tree.links[number].joint != BASE for number in links], dtype=np.bool_),
        balls=balls_of([body for _, body in bodies]),
        own=own_pairs(tree, bodies, pairs),
        plan=plan,
    )


def _standing(fixture: Fixture, links: set[str]) -> Obstacles:
    what = f"fixture {fixture.name}"
    for link in fixture.ignore:
        if link not in links:
            raise MeshError(what, f"ignore {link!r}: no such link in its cell{nearest(link, sorted(links))}")
    bodies = (exact_bodies if fixture.exact else piece_bodies)(fixture.shapes)
    if not bodies:
        raise MeshError(what, "has no surface: nothing could be checked against it")
    placements = np.tile(np.asarray(fixture.fixture_to_site, dtype=np.float64), (len(bodies), 1, 1))
    return Obstacles((fixture.name,) * len(bodies), bodies, placements, np.zeros(len(bodies), dtype=np.bool_))


def pending(cell: Cell) -> tuple[str, ...]:
    """Arms of a cell whose own links are still being studied."""
    return tuple(name for name, arm in cell.arms.items() if arm.plan.pending)


def unshaped(cell: Cell, robot: str) -> tuple[str, ...]:
    """Links of an arm that no check covers, for they have no shape.

    A bare frame on a link that has one is none of them, unless files of meshes are missing: it may be theirs.
    """
    return tuple(cell.arms[robot].tree.links[number].name for number in _bare(cell, robot))


def unshaped_moving(cell: Cell, robot: str) -> tuple[str, ...]:
    """Those of the `unshaped` links that a joint moves: the check cannot say that a motion is free."""
    links = cell.arms[robot].tree.links
    return tuple(links[number].name for number in _bare(cell, robot) if links[number].joint != BASE)


def _bare(cell: Cell, robot: str) -> tuple[int, ...]:
    arm = cell.arms[robot]
    shaped = set(arm.links.tolist())
    if missing_meshes(cell, robot):
        return tuple(number for number in range(len(arm.tree.links)) if number not in shaped)
    return bare_links(arm.tree, shaped)


def missing_meshes(cell: Cell, robot: str) -> tuple[str, ...]:
    """Mesh files of an arm that were not found, as its description names them: no check covers them."""
    description = cell.arms[robot].description
    return description.robot.unchecked if isinstance(description, UrdfDescription) else ()


def distances(cell: Cell, pair: tuple[str, str]) -> tuple[float, float]:
    """Warning and stop distance of two that stand apart, as `Nearest` names them [m].

    For two robots the larger of both counts; the floor has its own.
    """
    if FLOOR in pair:
        return (cell.floor.warning_m, cell.floor.stop_m) if cell.floor is not None else (0.0, 0.0)
    arms = [arm for name in pair if (arm := cell.arms.get(name.partition("/")[0])) and "/" in name]
    return max(arm.warning_m for arm in arms), max(arm.stop_m for arm in arms)
