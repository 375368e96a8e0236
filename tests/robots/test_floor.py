"""The floor: the half-space below a height, which an arm's moving links must not enter."""

import xml.etree.ElementTree as Xml
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from robomesh import reason_codes as codes
from robots.checks.check import check_plan, check_program
from robots.collision import build_cell, outside_clearance, outside_nearest, path_encounters
from robots.collision.floor import heights_above
from robots.collision.path import placements_along
from robots.descriptions.cells import FLOOR, CellDescription, CellRobot, Floor
from robots.programs.steps import Step, StepKind, ViolationKind
from tests.robots.boxes import block, placed

# The tool of a Pt600 comes down in front of the arm.
DOWN = "move_joints 0 0 -60 0 0\n"


def pt600(height_m: float = 0.0, **more: object) -> CellDescription:
    return CellDescription((CellRobot("arm", "pt600", placed(0.0, 0.0, height_m)),), **more)  # type: ignore[arg-type]


def checked(description: CellDescription, text: str, start=None):
    cell = build_cell(description)
    home = cell.arms["arm"].joints.home
    return check_program(text, cell, "arm", home if start is None else start)


def go(*targets: np.ndarray) -> list[Step]:
    return [Step(line=0, kind=StepKind.MOVE, target=target) for target in targets]


def test_a_program_that_drives_the_tool_below_the_drawn_floor_is_refused() -> None:
    result = checked(pt600(), DOWN)
    found = [each for each in result.violations if each.pair[1] == FLOOR]
    assert found
    assert {each.kind for each in found} == {ViolationKind.COLLISION}
    assert result.refused
    for each in found:
        assert each.distance_m == 0.0
        (_, _, low), (_, _, floor) = each.points
        assert floor == 0.0
        assert each.text == f"{each.pair[0]} goes {-low * 1000:.1f} mm below the floor"
    assert not result.alone


def test_only_contact_counts_unless_a_warning_distance_is_given() -> None:
    steps = checked(pt600(floor=None), DOWN).steps
    cell = build_cell(pt600(floor=None))
    path = path_encounters(cell, "arm", np.array([steps[-1].target]), {}, within_m=0.0)
    assert path.encounters == ()
    arm = cell.arms["arm"]
    end = np.array([steps[-1].target])
    lowest = heights_above(Floor(0.0), arm, placements_along(arm, end)).heights.min()

    def kinds(floor):
        return {each.kind for each in checked(pt600(floor=floor), DOWN).violations}

    assert kinds(Floor(lowest - 0.001)) == set()
    assert kinds(Floor(lowest + 0.001)) == {ViolationKind.COLLISION}
    assert kinds(Floor(lowest - 0.02, warning_m=0.05, stop_m=0.01)) == {ViolationKind.CLEARANCE}
    assert checked(pt600(floor=Floor(lowest - 0.02, 0.05, 0.03)), DOWN).refused
    assert not checked(pt600(floor=Floor(lowest - 0.02, 0.05, 0.01)), DOWN).refused


def test_the_floor_is_below_the_lowest_base_of_the_cell() -> None:
    assert pt600(0.7).floor_m == 0.7
    high, low = (
        CellRobot(name, "pt600", placed(0.0, y, z)) for name, y, z in (("a", 0, 0.5), ("b", 2, -0.2))
    )
    assert CellDescription((high, low)).floor_m == -0.2
    assert CellDescription((high, low), floor=Floor(-1.0)).floor_m == -1.0
    assert CellDescription((high, low), floor=None).floor_m is None


def test_links_fixed_to_a_base_may_reach_below_the_floor() -> None:
    cell = build_cell(pt600(floor=Floor(0.1)))
    arm = cell.arms["arm"]
    found = path_encounters(cell, "arm", np.array([arm.joints.home]), {}, within_m=0.0)
    assert "arm/base" not in {name for each in found.encounters for name in each.pair}
    assert arm.bodies[0].corners[:, 2].min() < 0.1


def test_arm_below_the_floor_may_move_up_but_not_down() -> None:
    cell = build_cell(pt600())
    home = cell.arms["arm"].joints.home
    low = checked(pt600(floor=None), DOWN).steps[-1].target
    lower = low + np.radians([0.0, -4.0, 0.0, 0.0, 0.0])

    def violations(start, *targets):
        found = check_plan(cell, "arm", start, go(*targets), others={}).violations
        return [each for each in found if each.pair[1:] == (FLOOR,)]

    assert violations(home, low)
    assert not violations(low, home)
    assert not violations(low, low + np.radians([30.0, 0.0, 0.0, 0.0, 0.0]))
    assert violations(low, lower)
    # Up, and then below again: that is no longer a retreat.
    assert violations(low, home, low)


WHEEL = """<robot name="wheel"><link name="base"/>
<link name="spoke"><visual><origin xyz="0 0 -0.01"/>
<geometry><box size="0.001 0.02 0.02"/></geometry></visual></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="spoke"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint></robot>"""


def test_a_link_that_dips_into_the_floor_between_two_samples_is_found(tmp_path: Path) -> None:
    (tmp_path / "wheel.urdf").write_text(WHEEL)
    robot = CellRobot("arm", tmp_path / "wheel.urdf", np.eye(4))
    path = np.array([[-0.1], [0.1]])
    # Its end is at -0.02 m when it hangs down, and 0.05 mm higher at both samples.
    for height_m, touches in ((-0.01996, True), (-0.02005, False)):
        cell = build_cell(CellDescription((robot,), floor=Floor(height_m)))
        found = path_encounters(cell, "arm", path, {}, within_m=0.0).encounters
        assert [each.pair for each in found] == [("arm/spoke", FLOOR)] * touches
        heights = heights_above(Floor(height_m), cell.arms["arm"], placements_along(cell.arms["arm"], path))
        assert heights.heights.min() > 0.0


def test_without_a_floor_and_fixtures_only_the_arm_itself_was_checked() -> None:
    bare = checked(pt600(floor=None), "move_joints 10 0 0 0 0\n")
    assert bare.ok
    assert bare.alone
    assert bare.notes[-1] == codes.CHECK_NOTE_ALONE()
    table = block("table", (0.1, 0.1, 0.1), placed(3.0))
    assert not checked(pt600(floor=None, fixtures=(table,)), "move_joints 10 0 0 0 0\n").alone
    assert not checked(pt600(), "move_joints 10 0 0 0 0\n").alone


def test_live_clearance_includes_the_floor_only_with_a_warning_distance() -> None:
    for floor, known in ((Floor(), False), (Floor(0.0, 0.5, 0.01), True), (None, False)):
        cell = build_cell(pt600(floor=floor))
        home = cell.arms["arm"].joints.home
        nearest = outside_clearance(cell, "arm", home, {})
        assert (nearest is not None) == known
        pairs = [each.pair[1] for each in outside_nearest(cell, "arm", home, {}, within_m=0.5)]
        assert (FLOOR in pairs) == known
        if nearest is not None:
            arm = cell.arms["arm"]
            lowest = heights_above(Floor(0.0), arm, placements_along(arm, home[None])).heights.min()
            assert nearest.distance_m == pytest.approx(lowest)
            assert nearest.points[1][2] == 0.0


@pytest.mark.parametrize(
    "urdf",
    ["abb_irb2400_support/urdf/irb2400_12_155.urdf", "motoman_gp8_support/urdf/gp8.urdf"],
)
@pytest.mark.slow
def test_heights_equal_pinocchios_of_the_same_file(shared: Path, urdf: str) -> None:
    folder = shared / "testdata/urdf"
    path = folder / urdf
    cell = build_cell(
        CellDescription((CellRobot("arm", path, placed(0.0, 0.0, 0.3)),), floor=Floor(-0.25)), exact=True
    )
    arm = cell.arms["arm"]
    model = pin.buildModelFromUrdf(str(path))
    shapes = pin.buildGeomFromUrdf(model, str(path), pin.GeometryType.COLLISION, package_dirs=[str(folder)])
    data, placed_shapes = model.createData(), shapes.createData()
    mimics = {
        joint.get("name"): (
            follows.get("joint"),
            float(follows.get("multiplier", 1)),
            float(follows.get("offset", 0)),
        )
        for joint in Xml.parse(path).iter("joint")
        for follows in joint.findall("mimic")
    }

    def configuration(row) -> np.ndarray:
        """Return Pinocchio's positions, joint by joint: a mimic joint has its own position there."""
        values = dict(zip(arm.joints.names, row.tolist(), strict=True))
        found = []
        for name, joint in zip(list(model.names)[1:], list(model.joints)[1:], strict=True):
            leader, multiplier, offset = mimics.get(name, (name, 1.0, 0.0))
            angle = multiplier * values[leader] + offset
            found += [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
        return np.array(found)

    # Only links that a joint moves; the others may reach into the floor.
    moving = [
        shape.geometry.vertices() * shape.meshScale if shape.parentJoint > 0 else np.empty((0, 3))
        for shape in shapes.geometryObjects
    ]
    rng = np.random.default_rng(3)
    positions = rng.uniform(arm.joints.lower, arm.joints.upper, (20, len(arm.joints)))
    ours = heights_above(Floor(-0.25), arm, placements_along(arm, positions)).heights.min(axis=1)
    for row, found in zip(positions, ours, strict=True):
        pin.updateGeometryPlacements(model, data, shapes, placed_shapes, configuration(row))
        lowest = min(
            float((corners @ at.rotation[2]).min() + at.translation[2])
            for at, corners in zip(placed_shapes.oMg, moving, strict=True)
            if len(corners)
        )
        assert found == pytest.approx(lowest + 0.3 + 0.25, abs=2e-5)
