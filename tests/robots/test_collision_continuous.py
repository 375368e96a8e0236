"""Clearances of an arm on a path: equal to those of each sample, but faster."""

import re
from itertools import pairwise
from math import pi
from pathlib import Path

import numpy as np
import pytest

from robots.collision import (
    Cell,
    allowed_positions,
    build_cell,
    outside_nearest,
    own_contacts,
    path_encounters,
)
from robots.collision.cell import Arm
from robots.collision.distance import arm_obstacles
from robots.collision.path import SAMPLE_M, pieces_of, placements_along, sampled_pieces, travelled
from robots.descriptions.cells import CellDescription, CellRobot
from robots.kinematics.joints import FloatArray
from tests.robots.arms import TELESCOPE
from tests.robots.boxes import bar_arm, block, cell_of, globe, placed

WITHIN = 0.05
FIXTURES = (
    block("table", (2.0, 2.0, 0.05), placed(0.0, 0.0, -0.1)),
    block("post", (0.1, 0.1, 1.0), placed(0.4, 0.4, 0.5)),
    globe("ball", 0.15, placed(-0.3, 0.4, 0.6)),
)


@pytest.fixture(scope="module")
def cell() -> Cell:
    robots = (CellRobot("one", "pt600", placed(0.0)), CellRobot("two", "pt500", placed(0.8, yaw=pi)))
    return build_cell(CellDescription(robots, FIXTURES))


def motions(cell: Cell, robot: str, count: int, seed: int) -> FloatArray:
    """Return straight joint motions between random positions, in samples of about 20 mm."""
    ends = allowed_positions(cell.arms[robot].joints, count + 1, seed)
    shares = np.linspace(0.0, 1.0, 60)[1:, None]
    lines = [start + shares * (end - start) for start, end in pairwise(ends)]
    return np.concatenate([ends[:1], *lines])


def measured(
    cell: Cell, positions: FloatArray, others: dict[str, FloatArray]
) -> tuple[float, dict[tuple[str, str], float]]:
    """Return the least distance and the near pairs, for one position."""
    moving = [pair for pair in outside_nearest(cell, "one", positions, others) if pair.pair[0] != "one/base"]
    near = {each.pair: each.distance_m for each in moving if each.distance_m <= WITHIN}
    near |= {each.pair: 0.0 for each in own_contacts(cell, "one", positions)}
    return min(each.distance_m for each in moving), near


@pytest.mark.parametrize("beside", [{}, {"two": np.radians([[20.0, 60.0, -60.0, 10.0, 0.0]])}])
def test_path_check_equals_the_check_of_each_sample(cell: Cell, beside: dict[str, FloatArray]) -> None:
    path = motions(cell, "one", 12, seed=4)
    along = path_encounters(cell, "one", path, beside, within_m=WITHIN)
    seen: dict[int, dict[tuple[str, str], float]] = {}
    for each in along.encounters:
        assert list(each.samples) == sorted(set(each.samples))
        gaps = np.linalg.norm(each.points[:, 0] - each.points[:, 1], axis=1)
        apart = each.distances > 0
        assert gaps[apart] == pytest.approx(each.distances[apart], abs=1e-6)
        for sample, distance in zip(each.samples.tolist(), each.distances.tolist(), strict=True):
            seen.setdefault(sample, {})[each.pair] = distance
    near = touching = 0
    for sample in range(0, len(path), 7):
        least, expected = measured(
            cell, path[sample], {name: positions[0] for name, positions in beside.items()}
        )
        assert along.clearances[sample] == pytest.approx(least, abs=1e-5)
        assert seen.get(sample, {}) == {pair: pytest.approx(d, abs=1e-5) for pair, d in expected.items()}
        near += bool(expected)
        touching += least == 0.0
    # The path must have encounters and free samples to show anything.
    assert 5 < near < len(path) / 7 - 5
    assert touching > 0


def sampled_path(arm: Arm, path: FloatArray) -> tuple[FloatArray, FloatArray]:
    lines = np.stack([path[:-1], path[1:]], axis=1)
    pieces = [placements[1:] for placements, _ in sampled_pieces(arm, pieces_of(lines))]
    placements = np.concatenate([placements_along(arm, path[:1]), *pieces])
    return placements, travelled(arm.bodies, placements)


@pytest.mark.slow
def test_another_arms_path_counts_as_all_of_its_positions(cell: Cell) -> None:
    # The neighbour passes the arm: at both ends of its path it is far away.
    way = np.radians([[-100.0, 60.0, -60.0, 10.0, 0.0], [100.0, 60.0, -60.0, 10.0, 0.0]])
    path = motions(cell, "one", 3, seed=11)
    swept = path_encounters(cell, "one", path, {"two": way}, within_m=WITHIN).clearances
    places, _ = sampled_path(cell.arms["two"], way)
    count = len(places)
    stands = [way[0] + share * (way[1] - way[0]) for share in np.linspace(0.0, 1.0, count)]
    for sample in range(0, len(path), 25):
        # Every tenth position: not nearer than all of them, and not farther than the interval allows.
        found = [measured(cell, path[sample], {"two": positions})[0] for positions in stands[::10]]
        assert swept[sample] <= min(found) + 1e-6
        assert swept[sample] >= min(found) - 10 * SAMPLE_M
    ends = [path_encounters(cell, "one", path, {"two": end[None]}, within_m=WITHIN).clearances for end in way]
    assert (swept < np.minimum(*ends) - 0.05).any()


def test_path_is_sampled_so_that_no_link_moves_more_than_five_millimetres(cell: Cell) -> None:
    arm = cell.arms["one"]
    # A full turn, with both ends at the same place.
    way = np.array([[-pi, 1.0, -1.0, 0.0, -pi], [pi, 1.0, -1.0, 0.0, pi], [pi, 1.2, -1.0, 0.0, 0.0]])
    places, come = sampled_path(arm, way)
    assert np.diff(come, axis=0).max() <= SAMPLE_M
    # The hand, at a radius of 0.5 m, makes a little more than one turn.
    assert come[-1].max() > 2.0
    assert places[0] == pytest.approx(arm_obstacles(arm, way[0]).placements, abs=1e-12)
    assert places[-1] == pytest.approx(arm_obstacles(arm, way[-1]).placements, abs=1e-12)


def test_body_placements_equal_pinocchios(cell: Cell, tmp_path: Path) -> None:
    # Prismatic joints and a mimic joint; a shape for each of its bare links.
    urdf = tmp_path / "telescope.urdf"
    look = r'<link name="\1"><visual><geometry><box size="0.1 0.05 0.02"/></geometry></visual></link>'
    urdf.write_text(re.sub(r'<link name="(\w+)"/>', look, TELESCOPE))
    others = cell_of(
        {"bars": (bar_arm(tmp_path / "bars"), placed(0.3, yaw=0.4)), "lift": (urdf, placed(1.0))}
    )
    for arm in (*cell.arms.values(), *build_cell(others).arms.values()):
        assert arm.moving.any()
        path = allowed_positions(arm.joints, 20, seed=2)
        for placements, positions in zip(placements_along(arm, path), path, strict=True):
            assert placements == pytest.approx(arm_obstacles(arm, positions).placements, abs=1e-12)


def test_travel_bounds_the_movement_of_every_point(cell: Cell) -> None:
    arm = cell.arms["one"]
    path = motions(cell, "one", 2, seed=3)
    places = placements_along(arm, path)
    come = travelled(arm.bodies, places)
    for number, body in enumerate(arm.bodies):
        points = body.center + np.random.default_rng(1).uniform(-1, 1, (50, 3)) * body.half
        at = np.einsum("mij,kj->mki", places[:, number, :3, :3], points) + places[:, number, None, :3, 3]
        for later in (1, 10, 100):
            moved = np.linalg.norm(at[later:] - at[:-later], axis=2).max(axis=1)
            assert (moved <= come[later:, number] - come[:-later, number] + 1e-12).all()


def test_arm_without_shapes_has_no_encounters(tmp_path: Path) -> None:
    bare = bar_arm(tmp_path / "bare", bare=("base", "shoulder", "elbow"))
    robots = {"bare": (bare, placed(0.0)), "seen": (bar_arm(tmp_path / "seen"), placed(0.1))}
    cell = build_cell(cell_of(robots, FIXTURES))
    path = np.array([[0.0, 0.0], [1.0, 1.0]])
    for robot, other in (("bare", "seen"), ("seen", "bare")):
        along = path_encounters(cell, robot, path, {other: path}, within_m=WITHIN)
        names = {name for each in along.encounters for name in each.pair}
        assert not any(name.startswith("bare/") for name in names)
    assert path_encounters(cell, "bare", path, {}, within_m=WITHIN).clearances.tolist() == [np.inf, np.inf]


def test_clearance_without_obstacles_is_infinite(tmp_path: Path) -> None:
    cell = build_cell(cell_of({"arm": (bar_arm(tmp_path), placed(0.0))}))
    folded = np.array([0.0, pi])
    along = path_encounters(cell, "arm", np.array([np.zeros(2), folded]), {}, within_m=WITHIN)
    assert along.clearances.tolist() == [np.inf, np.inf]
    (contact,) = along.encounters
    assert contact.own
    assert contact.pair == ("arm/base", "arm/elbow")
    assert contact.samples.tolist() == [1]
