"""A cell in memory: its arms, fixtures and floor, ready for collision checks.

`build_cell` reads the files that a `robots.descriptions.cells.CellDescription` names.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from robots.bodies.geometry import Body, exact_bodies, hull_bodies, piece_bodies
from robots.bodies.link_pairs import PairPlan, plan_pairs
from robots.bodies.self_collision import SelfPairs, self_pairs
from robots.collision.obstacles import Balls, Bounds, Obstacles, balls_of, bounds_of, join_obstacles
from robots.descriptions.cells import FLOOR, CellDescription, CellRobot, Fixture, Floor
from robots.descriptions.description import load
from robots.kinematics.joints import FloatArray, Joints
from robots.kinematics.kinematic_tree import BASE, Tree, bare_links, tree_of
from robots.kinematics.model import RobotModel, build_model
from robots.schema.errors import ShapeError
from robots.schema.robot_toml import Model, RobotDescription, UrdfDescription, nearest


@dataclass(frozen=True, eq=False)
class Arm:
    """An arm, ready for collision checks.

    Attributes:
        base_to_site: (4, 4) [m].
        bodies: The arm's bodies, each in the frame of its link.
        names: "<robot>/<link>" of each body.
        links: (b,) number of each body's link in the model.
        moving: (b,) whether a joint moves the body.
        balls: Balls that cover the bodies.
        bounds: The bodies' bounding boxes.
        own: The pairs of bodies for the self-collision check.
        plan: The decisions on these pairs.
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
    bounds: Bounds
    own: SelfPairs
    plan: PairPlan


@dataclass(frozen=True, eq=False)
class Cell:
    """A cell, ready for collision checks. Not thread-safe: every call uses the same workspaces.

    Attributes:
        arms: By name.
        fixtures: The bodies of all fixtures.
        floor: With its height; None without a floor.
        ignored: Pairs of link and fixture that may touch, named as in `Nearest`.
    """

    arms: Mapping[str, Arm]
    fixtures: Obstacles
    floor: Floor | None
    ignored: frozenset[tuple[str, str]]
    surroundings: dict[tuple[str, ...], "Surroundings"] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Fixtures and other arms around an arm, independent of their positions.

    Attributes:
        arms: The other arms that are counted.
        obstacles: The fixtures and these arms, with placements of the fixtures only.
        checked: (a, b) which pairs of the arm's bodies and the obstacles are checked.
    """

    arms: tuple[Arm, ...]
    obstacles: Obstacles
    checked: NDArray[np.bool_]


def surroundings_of(cell: Cell, robot: str, others: Iterable[str]) -> Surroundings:
    """Return the surroundings of an arm; two bodies that do not move are not checked against each other.

    Args:
        others: The robots that are counted; the arm itself never is.
    """
    key = (robot, *others)
    found = cell.surroundings.get(key)
    if found is None:
        found = cell.surroundings[key] = _surroundings(cell, cell.arms[robot], key[1:])
    return found


def _surroundings(cell: Cell, arm: Arm, others: Sequence[str]) -> Surroundings:
    arms = tuple(cell.arms[name] for name in others if name != arm.name)
    nowhere = [
        Obstacles(each.names, each.bodies, np.empty((0, 4, 4)), each.moving, each.bounds) for each in arms
    ]
    around = join_obstacles([cell.fixtures, *nowhere])
    checked: NDArray[np.bool_] = arm.moving[:, None] | around.moving
    if cell.ignored:
        checked &= [[(one, other) not in cell.ignored for other in around.names] for one in arm.names]
    return Surroundings(arms, around, checked)


def build_cell(description: CellDescription, *, exact: bool = False, wait: bool = True) -> Cell:
    """Read the robots and fixtures of a cell.

    Args:
        exact: Check links as surfaces instead of hulls: distances are about a hundred times slower.
        wait: Wait for the studies of links with touching hulls. Otherwise the studies continue and the cell
            is `pending`.

    Raises:
        DescriptionError: If a robot's description has a problem.
        ShapeError: If a shape cannot be read, or a fixture has no surface.
    """
    arms = {robot.name: _arm(robot, exact=exact, wait=wait) for robot in description.robots}
    links = {f"{arm.name}/{link}" for arm in arms.values() for link in arm.model.link_names}
    return Cell(
        arms,
        join_obstacles([_fixture_obstacles(fixture, links) for fixture in description.fixtures]),
        description.floor and replace(description.floor, height_m=description.floor_m),
        frozenset((link, fixture.name) for fixture in description.fixtures for link in fixture.ignore),
    )


@lru_cache(maxsize=8)
def _read(model: Model, confined: bool, exact: bool) -> tuple[RobotDescription, tuple[tuple[int, Body], ...]]:
    """Read a robot's description and its links' bodies; cached, because a plant has many equal arms."""
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
        bounds=bounds_of([body for _, body in bodies]),
        own=self_pairs(tree, bodies, pairs),
        plan=plan,
    )


def _fixture_obstacles(fixture: Fixture, links: set[str]) -> Obstacles:
    source = f"fixture {fixture.name}"
    for link in fixture.ignore:
        if link not in links:
            hint = nearest(link, sorted(links))
            raise ShapeError(source, f"ignore {link!r}: no such link in its cell{hint}")
    bodies = (exact_bodies if fixture.exact else piece_bodies)(fixture.shapes)
    if not bodies:
        raise ShapeError(source, "has no surface, so it cannot be checked for collisions")
    placements = np.tile(np.asarray(fixture.fixture_to_site, dtype=np.float64), (len(bodies), 1, 1))
    moving = np.zeros(len(bodies), dtype=np.bool_)
    return Obstacles((fixture.name,) * len(bodies), bodies, placements, moving, bounds_of(bodies))


def pending(cell: Cell) -> tuple[str, ...]:
    """Return the arms of a cell of which the links are still being studied."""
    return tuple(name for name, arm in cell.arms.items() if arm.plan.pending)


def unshaped(cell: Cell, robot: str) -> tuple[str, ...]:
    """Return the links of an arm without a shape, which no check covers.

    A frame on a link with a shape does not count, unless shape files are missing: one may be its shape.
    """
    return tuple(cell.arms[robot].tree.links[number].name for number in _bare(cell, robot))


def unshaped_moving(cell: Cell, robot: str) -> tuple[str, ...]:
    """Return the `unshaped` links that a joint moves: no check can prove their motion free of collisions."""
    links = cell.arms[robot].tree.links
    return tuple(links[number].name for number in _bare(cell, robot) if links[number].joint != BASE)


def _bare(cell: Cell, robot: str) -> tuple[int, ...]:
    arm = cell.arms[robot]
    shaped = set(arm.links.tolist())
    if missing_shapes(cell, robot):
        return tuple(number for number in range(len(arm.tree.links)) if number not in shaped)
    return bare_links(arm.tree, shaped)


def missing_shapes(cell: Cell, robot: str) -> tuple[str, ...]:
    """Return the shape files of an arm that were not found, as its description names them."""
    description = cell.arms[robot].description
    return description.robot.unchecked if isinstance(description, UrdfDescription) else ()


def distances(cell: Cell, pair: tuple[str, str]) -> tuple[float, float]:
    """Return the warning and stop distance of a pair that is named as in `Nearest` [m].

    For two robots, the larger distances apply. The floor has separate distances.
    """
    if FLOOR in pair:
        return (cell.floor.warning_m, cell.floor.stop_m) if cell.floor is not None else (0.0, 0.0)
    arms = [arm for name in pair if (arm := cell.arms.get(name.partition("/")[0])) and "/" in name]
    return max(arm.warning_m for arm in arms), max(arm.stop_m for arm in arms)
