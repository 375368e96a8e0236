"""Contacts between two samples, on another robot's long path, and on many small motions."""

from pathlib import Path

import numpy as np
import pytest

from robots.checks.check import check_plan
from robots.collision import Cell, allowed_positions, build_cell, outside_nearest, path_encounters
from robots.collision.distance import Gauge
from robots.collision.path import placements_along
from robots.collision.swept_volumes import sweeps_of
from robots.descriptions.cells import CellDescription, CellRobot
from robots.programs.steps import CheckReport, Step, StepKind, ViolationKind
from tests.robots.boxes import bar_arm, block, cell_of, placed, two_cheeks

PLATE_M = 0.001
BLADE = """<robot name="blade">
<link name="base">
<collision><origin xyz="{x} 0 0.5"/><geometry><box size="{box}"/></geometry></collision></link>
<link name="slide"/>
<link name="blade"><collision><geometry><box size="0.001 0.1 0.1"/></geometry></collision></link>
<joint name="carry" type="revolute"><parent link="base"/><child link="slide"/><origin xyz="0.2 0 0.5"/>
<axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<joint name="push" type="prismatic"><parent link="slide"/><child link="blade"/>
<axis xyz="1 0 0"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint></robot>"""


def moved(cell: Cell, robot: str, start: list[float], target: list[float]) -> CheckReport:
    step = Step(line=1, kind=StepKind.MOVE, target=np.array(target))
    return check_plan(cell, robot, np.array(start), [step], others={})


def kinds(result: CheckReport) -> list[ViolationKind]:
    return [each.kind for each in result.violations]


@pytest.mark.parametrize("x_m", [0.5 + 0.00037 * number for number in range(14)])
def test_thin_blade_does_not_tunnel_through_a_thin_plate(tmp_path: Path, x_m: float) -> None:
    urdf = tmp_path / "blade.urdf"
    urdf.write_text(BLADE.format(x=0.0, box="0.05 0.05 0.05"))
    robot = CellRobot("blade", urdf, placed(0.0), warning_m=0.0, stop_m=0.0)
    plate = block("plate", (PLATE_M, 1.0, 1.0), placed(x_m, 0.0, 0.5))
    cell = build_cell(CellDescription((robot,), (plate,)))
    (violation,) = moved(cell, "blade", [0.0, 0.0], [0.0, 0.8]).violations
    assert violation.kind is ViolationKind.COLLISION
    assert violation.points[:, 0] == pytest.approx([x_m, x_m], abs=2 * PLATE_M)
    # Up to the plate, and past it.
    assert kinds(moved(cell, "blade", [0.0, 0.0], [0.0, x_m - 0.2 - 1.5 * PLATE_M])) == []
    assert kinds(moved(cell, "blade", [0.0, x_m - 0.2 + 1.5 * PLATE_M], [0.5, 0.8])) == []


def test_thin_blade_does_not_tunnel_through_a_plate_on_its_base(tmp_path: Path) -> None:
    for number in range(6):
        x_m = 0.5 + 0.00071 * number
        urdf = tmp_path / f"fin-{number}.urdf"
        urdf.write_text(BLADE.format(x=x_m, box="0.001 0.2 0.2"))
        cell = build_cell(CellDescription((CellRobot("blade", urdf, placed(0.0)),)))
        assert kinds(moved(cell, "blade", [0.0, 0.6], [0.5, 0.8])) == []
        assert kinds(moved(cell, "blade", [0.0, 0.2], [0.0, 0.6])) == [ViolationKind.COLLISION], x_m


@pytest.fixture(scope="module")
def cell_of_two(tmp_path_factory: pytest.TempPathFactory) -> Cell:
    bars = bar_arm(tmp_path_factory.mktemp("bars"))
    return build_cell(
        cell_of(
            {"arm": (bars, placed(0.0)), "other": (bars, placed(1.2))},
            (block("post", (0.1, 0.1, 0.4), placed(0, 1)),),
        )
    )


def test_far_does_not_change_near_encounters(cell_of_two: Cell) -> None:
    path = np.linspace([-1.0, 0.2], [1.5, 0.0], 200)
    way = allowed_positions(cell_of_two.arms["other"].joints, 8, 3)
    whole, near = (
        path_encounters(cell_of_two, "arm", path, {"other": way}, within_m=0.05, far=far)
        for far in (True, False)
    )
    expected = {each.pair: each for each in whole.encounters}
    assert any(pair[1].startswith("other/") for pair in expected)
    assert expected.keys() == {each.pair for each in near.encounters}
    for each in near.encounters:
        assert each.samples.tolist() == expected[each.pair].samples.tolist()
        assert each.distances == pytest.approx(expected[each.pair].distances, abs=1e-6)
    assert np.isfinite(whole.clearances).all()
    seen = whole.clearances < 0.05
    assert near.clearances[seen] == pytest.approx(whole.clearances[seen], abs=1e-6)


def test_two_pieces_are_encountered_in_order(tmp_path: Path) -> None:
    cheeks = two_cheeks("cheeks", placed(0.75))
    cell = build_cell(cell_of({"arm": (bar_arm(tmp_path), placed(0.0))}, (cheeks,)))
    path = np.linspace([-0.5, 0.0], [0.5, 0.0], 400)
    for positions in (path, path[::-1]):
        (encounter,) = [
            each
            for each in path_encounters(cell, "arm", positions, {}, within_m=0.02, far=False).encounters
            if each.pair == ("arm/elbow", "cheeks")
        ]
        assert {-1, 1} == set(np.sign(encounter.points[encounter.distances == 0.0, 0, 1]).tolist())
        # The space between them is free.
        assert (np.diff(encounter.samples) > 5).sum() == 1


def test_long_path_is_sampled_only_near_the_arm_and_each_line_once(cell_of_two: Cell) -> None:
    arm = cell_of_two.arms["arm"]
    places = placements_along(arm, np.linspace([-0.3, 0.0], [0.3, 0.0], 50))
    aside, across = [1.5, 0.0], [np.pi, 0.0]

    def sampled(way: list[list[float]]) -> int:
        others = {"other": np.array(way)}
        sweeps = sweeps_of(cell_of_two, "arm", others, placements=places, within_m=0.05)
        return sum(len(sweep.travel) for sweep in sweeps if len(sweep.travel) > 1)

    assert sampled([[0.0, 0.0], aside]) == 0
    once = sampled([aside, across])
    assert once > 0
    assert sampled([aside, across] * 50) == once
    assert sampled([aside, across, aside, [0.0, 0.0], aside]) == once


def test_robot_far_from_another_robots_long_path_measures_almost_nothing(
    cell_of_two: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    measured = 0
    distance = Gauge.distance

    def counted(*args: object) -> float:
        nonlocal measured
        measured += 1
        return distance(*args)  # type: ignore[arg-type]

    monkeypatch.setattr(Gauge, "distance", counted)
    # The other robot turns away from the arm, a hundred times, to a different position each time.
    way = np.random.default_rng(0).uniform([-1.5, -0.3], [1.5, 0.3], (101, 2))
    path = np.linspace([2.0, 0.0], [2.5, 0.0], 60)
    path_encounters(cell_of_two, "arm", path, {"other": way}, within_m=0.05, far=False)
    assert measured < 500


@pytest.mark.slow
def test_repeated_small_motions_never_pass_the_stop_distance() -> None:
    post = block("post", (0.06, 0.06, 1.0), placed(0.0, 0.45, 0.5))
    cell = build_cell(CellDescription((CellRobot("arm", "pt600", np.eye(4)),), (post,)))

    def clearance(turn: float) -> float:
        return outside_nearest(cell, "arm", np.array([turn, 0, 0, 0, 0]), {})[0].distance_m

    far, near = 0.0, np.pi / 2
    for _ in range(40):
        middle = (far + near) / 2
        far, near = (middle, near) if clearance(middle) > 0.0101 else (far, middle)
    assert clearance(far) == pytest.approx(0.0101, abs=1e-6)
    turn = far
    for _ in range(30):
        if moved(cell, "arm", [turn, 0, 0, 0, 0], [turn + 5e-5, 0, 0, 0, 0]).refused:
            break
        turn += 5e-5
    assert 0.01 <= clearance(turn) < 0.0101
    # A pair that is nearer than that may separate, but not come nearer at all.
    inside = turn + 2e-3
    assert 0.001 < clearance(inside) < 0.01
    assert not moved(cell, "arm", [inside, 0, 0, 0, 0], [inside - 0.1, 0, 0, 0, 0]).refused
    assert moved(cell, "arm", [inside, 0, 0, 0, 0], [inside + 1e-6, 0, 0, 0, 0]).refused
