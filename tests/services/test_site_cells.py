"""Cells of a site file: fixtures, checks of motion, and errors."""

import re
from pathlib import Path

import numpy as np
import pytest

from robots.collision import build_cell, distances, outside_clearance, unshaped
from robots.descriptions import description
from robots.descriptions.cells import CellDescription, Floor
from robots.descriptions.glb import link_geometry
from robots.shapes.geometry import bounds
from services.cells.descriptions import cells_of
from services.errors import SiteFileError
from services.site_file import site
from services.site_file.started_robots import read_started
from services.site_file.tables.fixtures import Fixture, fixture_shape
from tests.robots.boxes import bar_arm

ROBOT = '[[robot]]\nname = "arm"\nmodel = "pt600"\n'
IN_A = f'{ROBOT}cell = "a"\n'
TABLE = '[[fixture]]\ncell = "a"\nname = "table"\nbox = [800.0, 600.0, 50.0]\n'
BALL = '[[fixture]]\ncell = "a"\nname = "ball"\nsphere = 50.0\n'


def load(folder, text):
    path = folder / "site.toml"
    path.write_text(f'site = "hall"\n{text}', encoding="utf-8")
    return site.load(path)


def test_motions_are_warned_of_unless_the_file_says_otherwise(tmp_path):
    (robot,) = load(tmp_path, ROBOT).robot
    assert (robot.check, robot.clearance.warning, robot.clearance.stop) == ("warn", 50.0, 10.0)
    (robot,) = load(
        tmp_path, f'{ROBOT}check = "require"\nclearance = {{ warning = 80.0, stop = 0.0 }}\n'
    ).robot
    assert (robot.check, robot.clearance.warning, robot.clearance.stop) == ("require", 80.0, 0.0)


@pytest.mark.parametrize(
    ("shape", "low", "high"),
    [
        ({"box": (800.0, 600.0, 50.0)}, (-0.4, -0.3, -0.025), (0.4, 0.3, 0.025)),
        ({"cylinder": (100.0, 400.0)}, (-0.1, -0.1, -0.2), (0.1, 0.1, 0.2)),
        ({"sphere": 100.0}, (-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)),
    ],
)
def test_a_fixtures_middle_is_at_its_pose_and_it_is_never_too_small(shape, low, high):
    mesh = link_geometry([fixture_shape(Fixture(cell="a", name="x", **shape))])
    lowest, highest = bounds(mesh)
    assert lowest == pytest.approx(low, rel=0.005)
    assert highest == pytest.approx(high, rel=0.005)
    if "sphere" in shape:
        (part,) = mesh.parts
        corners = part.vertices[part.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        heights = (corners[:, 0] * normals).sum(axis=1) / np.linalg.norm(normals, axis=1)
        assert heights.min() >= 0.1 - 1e-9


def test_a_fixtures_shape_is_taken_from_the_files_own_folder_in_its_own_unit(tmp_path):
    (tmp_path / "post.wrl").write_text(
        "#VRML V2.0 utf8\nShape { geometry IndexedFaceSet { coord Coordinate { "
        "point [0 0 0, 2 0 0, 0 3 0] } coordIndex [0 1 2 -1] } }\n"
    )
    text = f'{IN_A}[[fixture]]\ncell = "a"\nname = "post"\nmesh = "post.wrl"\nmesh_scale = 0.01\n'
    (fixture,) = load(tmp_path, text).fixture
    _, highest = bounds(link_geometry([fixture_shape(fixture)]))
    assert highest == pytest.approx((0.02, 0.03, 0.0))


def test_a_fixture_whose_part_is_outside_of_its_folder_is_refused_for_no_check_would_see_it(tmp_path):
    (tmp_path / "cad").mkdir()
    for path in (tmp_path / "part.wrl", tmp_path / "cad" / "part.wrl"):
        path.write_text("#VRML V2.0 utf8\nShape { geometry Box { size 1 1 1 } }\n")
    text = f'{IN_A}[[fixture]]\ncell = "a"\nname = "hall"\nmesh = "cad/hall.wrl"\n'
    hall = tmp_path / "cad" / "hall.wrl"
    hall.write_text('#VRML V2.0 utf8\nInline { url "part.wrl" }\n')
    load(tmp_path, text)
    hall.write_text('#VRML V2.0 utf8\nInline { url "part.wrl" }\nInline { url "../part.wrl" }\n')
    with pytest.raises(
        SiteFileError, match=r"fixture hall: .* refers to '../part.wrl', which is not in its folder"
    ):
        load(tmp_path, text)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (ROBOT + TABLE, "fixture table: no robot has cell = 'a': no robot of this site has a cell"),
        (IN_A + TABLE.replace('"a"', '"b"'), "fixture table: no robot has cell = 'b': there are a"),
        (IN_A + TABLE.replace('"a"', '""'), "fixture table: no robot has cell = ''"),
        (IN_A + TABLE + TABLE, "fixture a/table and fixture a/table have one name: each needs its own"),
        (IN_A + TABLE.replace("table", "arm"), "robot arm and fixture a/arm have one name"),
        (IN_A + TABLE.replace("table", "Table"), "fixture.Table.name = 'Table': fixture 'Table' cannot be"),
        (
            IN_A + TABLE + "sphere = 3.0",
            "box and sphere given: must be exactly one of box, cylinder, sphere, mesh",
        ),
        (IN_A + TABLE.replace("box", "# "), "fixture.table: no shape given: must be exactly one of"),
        (IN_A + TABLE.replace("600", "-600"), "fixture.table.box.1 = -600.0: should be greater than 0"),
        (
            IN_A + TABLE.replace("box", "size"),
            "fixture.table.size is not a key that a site file has: there are cell, name, box, cylinder, ",
        ),
        (
            IN_A + TABLE.replace("[[", "[").replace("]]", "]"),
            "fixture: there may be several: write [[fixture]],",
        ),
        (IN_A + BALL + 'ignore = "arm/elbow"', "fixture.ball.ignore = 'arm/elbow': should be a list"),
        (IN_A + "[[console]]\nlisten = ''", "console: there is one: write [console], with one bracket"),
        (IN_A + TABLE + 'color = "grey"', "fixture.table.color = 'grey': should be as in \"#8a8f94\""),
        (IN_A + BALL + 'ignore = ["arm"]', "ignore 'arm': should be <robot>/<link> with a robot of its cell"),
        (IN_A + BALL + 'ignore = ["arm/elbw"]', "fixture ball: ignore: arm has no link 'elbw'"),
        (IN_A + BALL.replace("sphere = 50.0", 'mesh = "no.stl"'), "fixture ball: mesh = "),
        (ROBOT + 'check = "maybe"', "robot.arm.check = 'maybe': should be 'require', 'warn' or 'off'"),
        (
            ROBOT + "clearance = { warning = 5.0 }",
            "robot.arm.clearance: stop = 10 is more than warning = 5: a warning comes first",
        ),
        (ROBOT + "clearance = { stop = -1.0 }", "robot.arm.clearance.stop = -1.0"),
        (ROBOT + 'clearance = { stop = "1" }', "robot.arm.clearance.stop = '1'"),
    ],
)
def test_an_invalid_cell_is_named_with_what_would_be_right(tmp_path, text, words):
    with pytest.raises(SiteFileError) as raised:
        load(tmp_path, text)
    assert words in str(raised.value)
    assert str(tmp_path / "site.toml") in str(raised.value)


@pytest.mark.parametrize(
    ("text", "floor"),
    [
        ("", Floor()),
        ("floor = -250.0", Floor(-0.25)),
        ("floor = -250", Floor(-0.25)),
        ("floor = false", None),
        ("floor = { height = 10.0, warning = 50.0, stop = 20.0 }", Floor(0.01, 0.05, 0.02)),
        ("floor = { warning = 50.0 }", Floor(None, 0.05, 0.0)),
    ],
)
def test_a_site_file_gives_the_height_of_the_floor_or_that_there_is_none(tmp_path, text, floor):
    assert cells_of(load(tmp_path, ROBOT + text))["arm"].floor == floor
    # A floor given for one robot applies to its whole cell, in any order.
    mate = '[[robot]]\nname = "mate"\nmodel = "pt500"\ncell = "a"\npose = { xyz = [0.0, 0.0, -300.0] }\n'
    for both in (f"{IN_A}{text}\n{mate}", f"{mate}{IN_A}{text}\n"):
        cells = cells_of(load(tmp_path, both))
        assert cells["arm"].floor == cells["mate"].floor == floor
    assert CellDescription(cells["arm"].robots).floor_m == -0.3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (f"{ROBOT}floor = true", "height in mm, false, or a table"),
        (f'{ROBOT}floor = "low"', "height in mm, false, or a table"),
        (f"{ROBOT}floor = {{ warning = 5.0, stop = 10.0 }}", "stop = 10 is more than warning = 5"),
        (f"{ROBOT}floor = nan", "robot.arm.floor"),
        (
            f'{IN_A}floor = 0.0\n[[robot]]\nname = "mate"\nmodel = "pt500"\ncell = "a"\nfloor = false\n',
            "robots arm and mate give different floors, and their cell 'a' has one: give it once",
        ),
    ],
)
def test_an_invalid_floor_is_named(tmp_path, text, words):
    with pytest.raises(SiteFileError, match=re.escape(words)):
        load(tmp_path, text)


def test_a_robot_without_shapes_cannot_require_checks(tmp_path):
    (tmp_path / "bare.urdf").write_text(
        '<robot name="bare"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    )
    text = '[[robot]]\nname = "bare"\nmodel = "bare.urdf"\n'
    assert load(tmp_path, text).robot[0].check == "warn"
    with pytest.raises(SiteFileError, match="has no shapes that could be checked"):
        load(tmp_path, f'{text}check = "require"\n')


def test_a_robot_with_a_moving_link_without_a_shape_cannot_require_checks_nor_can_its_mates(tmp_path):
    bar_arm(tmp_path / "half", bare=("elbow",))
    half = '[[robot]]\nname = "half"\nmodel = "half/robot.toml"\ncell = "a"\n'
    mate = '[[robot]]\nname = "mate"\nmodel = "pt600"\ncell = "a"\npose = { xyz = [3000.0, 0.0, 0.0] }\n'
    assert len(load(tmp_path, half + mate).robot) == 2
    for text in (half + 'check = "require"\n' + mate, half + mate + 'check = "require"\n'):
        with pytest.raises(SiteFileError, match="elbow moves and has no shape that could be checked"):
            load(tmp_path, text)


def test_a_bare_frame_that_is_fixed_to_a_link_with_a_shape_counts_as_covered(tmp_path):
    tool = '<link name="tool0"/><joint name="t" type="fixed"><parent link="b"/><child link="tool0"/></joint>'
    whole = HALF.replace('<mesh filename="nowhere.stl"/>', '<sphere radius="0.1"/>')
    whole = whole.replace("</robot>", f"{tool}</robot>")
    (tmp_path / "whole.urdf").write_text(whole)
    text = '[[robot]]\nname = "whole"\nmodel = "whole.urdf"\ncheck = "require"\n'
    assert load(tmp_path, text).robot[0].check == "require"


HALF = (
    '<robot name="half"><link name="a"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>'
    '<link name="b"><visual><geometry><mesh filename="nowhere.stl"/></geometry></visual></link>'
    '<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
)


def test_a_robot_cannot_require_checks_beside_one_whose_shapes_are_missing(tmp_path):
    (tmp_path / "half.urdf").write_text(HALF)
    half = '[[robot]]\nname = "half"\nmodel = "half.urdf"\n'
    whole = '[[robot]]\nname = "arm"\nmodel = "pt600"\ncheck = "require"\n'
    with pytest.raises(SiteFileError, match=r"robot half: check.* no such mesh file: nowhere.stl"):
        load(tmp_path, f'{half}check = "require"\n')
    with pytest.raises(SiteFileError, match=r"robot arm: check.* robot half of its cell: .*nowhere.stl"):
        load(tmp_path, f'{half}cell = "a"\n{whole}cell = "a"\n')
    # In different cells they never collide.
    assert len(load(tmp_path, f"{half}{whole}").robot) == 2


def test_a_started_robot_has_no_cell(tmp_path):
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "started.toml").write_text(f'site = "hall"\n{IN_A.replace("arm", "second")}')
    with pytest.raises(SiteFileError, match="cells belong in the site file"):
        read_started(load(tmp_path, ROBOT))


def test_the_arms_of_the_example_cell_stand_clear_of_everything_at_home():
    example = Path(__file__).resolve().parents[2] / "examples" / "cell.toml"
    cells = cells_of(site.load(example))
    assert cells["left"] is cells["right"]
    assert [fixture.name for fixture in cells["left"].fixtures] == ["workbench", "post", "fence"]
    cell = build_cell(cells["left"])
    home = cell.arms["left"].joints.home
    for arm, other in (("left", "right"), ("right", "left")):
        nearest = outside_clearance(cell, arm, home, {other: home})
        warning, stop = distances(cell, nearest.pair)
        assert (warning, stop) == (0.05, 0.01)
        assert nearest.distance_m > 4 * warning
        assert unshaped(cell, arm) == ()


def test_a_robot_without_a_cell_is_alone_and_one_defined_on_the_page_reads_its_own_folder_only(tmp_path):
    saved = tmp_path / "robots" / "mine"
    saved.mkdir(parents=True)
    library = description.load("pt600").source
    text = library.read_text(encoding="utf-8").replace('name = "pt600"', 'name = "mine"', 1)
    (saved / "robot.toml").write_text(text, encoding="utf-8")
    (saved / "meshes").symlink_to(library.parent / "meshes")
    more = '[[robot]]\nname = "mine"\nmodel = "robots/mine/robot.toml"\ncell = "a"\n'
    cells = cells_of(load(tmp_path, f"{ROBOT}{more}{TABLE}"))
    (alone,) = cells["arm"].robots
    assert (alone.name, alone.confined, cells["arm"].fixtures) == ("arm", False, ())
    (mine,) = cells["mine"].robots
    assert (mine.confined, [fixture.name for fixture in cells["mine"].fixtures]) == (True, ["table"])
