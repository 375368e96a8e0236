"""Changes of cells in site files: only the wanted lines change, and nothing else is accepted."""

import difflib
import math
import tomllib
from pathlib import Path

import pytest

from robomesh import reason_codes as codes
from robomesh.errors import RefusedError
from robomesh.files.atomic_write import write_atomically
from robomesh.schemas import robomesh_pb2 as schema
from services.cells.content import MOST_FIXTURES, changes, summary, version_of
from services.cells.file import CellFile
from services.site_file.site import load
from tests.refusals import refused

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
EXAMPLE = (EXAMPLES / "cell.toml").read_text(encoding="utf-8")
ODD = """# A site file as people write them.
site = "odd"   # a comment behind a value

[[fixture]]    # in front of its robots
cell = "a"
name = "table"
# Measured on Monday.
box = [ 400,
  1200.0,  # wide
  200.0 ]
[fixture.pose]
xyz = [600.0, 0.0, 100.0]
# End of the table's pose.

# The post was moved in March.
[[fixture]]
name = "post"; cell = "a"
sphere = 40
[watch]
folder = "w#[[fixture]]"

[[robot]]
name = "arm"
model = "pt600"
cell = "a"
[robot.floor]
height = -10.0  # below the base

# The end.""".replace('"; cell', '"\ncell')


def opened(folder, text=EXAMPLE):
    path = folder / "site.toml"
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(text)
    return path, CellFile(path, load(path))


def changed(file, robot="left"):
    content = schema.CellContent()
    content.CopyFrom(file.content(robot))
    return content, {each.name: each for each in content.fixtures}


def lines_of_diff(before, after):
    rows = list(difflib.ndiff(before.splitlines(), after.splitlines()))
    return [row[2:] for row in rows if row[0] == "-"], [row[2:] for row in rows if row[0] == "+"]


def save(file, content, robot="left"):
    content = file.normal(robot, content)
    file.describe(robot, content)
    file.save(robot, content)
    return content


def test_a_moved_fixture_changes_its_own_line_only(tmp_path):
    path, file = opened(tmp_path)
    content, fixtures = changed(file)
    fixtures["workbench"].xyz.x, fixtures["workbench"].rpy.z = 0.6501, math.radians(30)
    fixtures["post"].cylinder.radius = 0.05
    content = save(file, content)
    removed, added = lines_of_diff(EXAMPLE, path.read_text())
    assert removed == [
        "pose = { xyz = [600.0, 0.0, 100.0] }",
        "cylinder = [40.0, 1200.0]                      # radius, and height along its z",
    ]
    assert [line for line in added if line] == [
        "pose = { xyz = [650.1, 0.0, 100.0], rpy = [0.0, 0.0, 30.0] }",
        "cylinder = [50.0, 1200.0]                      # radius, and height along its z",
    ]
    # Another reader of the file finds the same, and the gateway's version after a restart.
    row = next(row for row in tomllib.loads(path.read_text())["fixture"] if row["name"] == "workbench")
    assert row["pose"] == {"xyz": [650.1, 0.0, 100.0], "rpy": [0.0, 0.0, 30.0]}
    assert version_of(CellFile(path, load(path)).content("right")) == version_of(content)


def test_undo_restores_the_file_byte_for_byte(tmp_path):
    path, file = opened(tmp_path)
    before = file.content("left")
    content, fixtures = changed(file)
    content.fixtures.remove(fixtures["fence"])
    content.floor.height = -0.25
    save(file, content)
    assert tomllib.loads(path.read_text())["robot"][0]["floor"] == -250.0
    assert path.with_name("site.toml.1").read_text() == EXAMPLE
    assert file.previous("right") == before
    save(file, file.previous("left"))
    assert path.read_text() == EXAMPLE


def test_restore_takes_back_a_change_and_keeps_the_earlier_file(tmp_path):
    path, file = opened(tmp_path)
    for x in (0.61, 0.62):
        content, fixtures = changed(file)
        fixtures["workbench"].xyz.x = x
        save(file, content)
    older = path.with_name("site.toml.1").read_text()
    content, fixtures = changed(file)
    fixtures["workbench"].xyz.x = 0.63
    text = path.read_text()
    save(file, content)
    file.restore()
    assert (path.read_text(), path.with_name("site.toml.1").read_text()) == (text, older)
    assert version_of(file.content("left")) == version_of(CellFile(path, load(path)).content("left"))


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_other_forms_of_tables_keep_their_comments(tmp_path, newline):
    text = ODD.replace("\n", newline)
    path, file = opened(tmp_path, text)
    content, fixtures = changed(file, "arm")
    fixtures["table"].xyz.y = 0.01
    content.fixtures.remove(fixtures["post"])
    content.floor.height = -0.02
    ball = content.fixtures.add(name="ball", sphere=0.1, color="#102030", ignore=["arm/base"])
    ball.xyz.z = 1.5
    save(file, content, "arm")
    with path.open(encoding="utf-8", newline="") as saved:
        after = saved.read()
    removed, added = lines_of_diff(text, after)
    assert removed == [
        "xyz = [600.0, 0.0, 100.0]",
        'name = "post"',
        "sphere = 40",
        "height = -10.0  # below the base",
    ]
    assert [line for line in added if line] == [
        "xyz = [600.0, 10.0, 100.0]",
        'name = "ball"',
        "sphere = 100.0",
        'color = "#102030"',
        'ignore = ["arm/base"]',
        "pose = { xyz = [0.0, 0.0, 1500.0] }",
        "height = -20.0  # below the base",
    ]
    comments = [line for line in text.splitlines() if "#" in line]
    assert [line for line in comments if line not in after] == ["height = -10.0  # below the base"]
    assert after.count("\r\n") == (after.count("\n") if newline == "\r\n" else 0)


def test_a_file_that_was_changed_on_disk_is_refused(tmp_path):
    path, file = opened(tmp_path)
    content, fixtures = changed(file)
    fixtures["post"].xyz.x = 0.0
    text = EXAMPLE + "# a colleague was here\n"
    path.write_text(text)
    with refused(codes.CELL_FILE_CHANGED):
        save(file, content)
    assert path.read_text() == text
    assert not path.with_name("site.toml.1").exists()


def test_a_file_in_a_form_that_cannot_be_changed_alone_is_refused(tmp_path):
    text = EXAMPLE.partition("[[fixture]]")[0].replace(
        'site = "cell"', 'site = "cell"\nfixture = [{ cell = "a", name = "ball", sphere = 10.0 }]'
    )
    path, file = opened(tmp_path, text)
    content, fixtures = changed(file)
    fixtures["ball"].sphere = 0.02
    with refused(codes.CELL_FILE_FORM):
        save(file, content)
    assert path.read_text() == text


def test_a_site_without_a_file_cannot_be_changed(tmp_path):
    path, _ = opened(tmp_path)
    file = CellFile(None, load(path))
    content, fixtures = changed(file)
    fixtures["post"].xyz.x = 0.0
    assert file.problem("left").code == "cell.no_file"
    with refused(codes.CELL_NO_FILE):
        save(file, content)


@pytest.mark.parametrize("written", [0, 1])
def test_a_full_disk_leaves_the_file(tmp_path, monkeypatch, written):
    path, file = opened(tmp_path)
    content, fixtures = changed(file)
    fixtures["post"].xyz.x = 0.0

    def full(target, data, **options):
        nonlocal written
        if not written:
            raise OSError(28, "No space left on device")
        written -= 1
        write_atomically(target, data, **options)

    monkeypatch.setattr("services.cells.file.write_atomically", full)
    with refused(codes.CELL_DISK):
        save(file, content)
    assert path.read_text() == EXAMPLE
    assert file.content("left") != content


def _many(content):
    for number in range(MOST_FIXTURES + 1):
        content.fixtures.add(name=f"f{number}", sphere=0.1)


def _mesh(content):
    content.fixtures.add(name="m").mesh.CopyFrom(schema.CellMesh(file="/etc/passwd", scale=1.0))


INVALID = {
    "no shape": (lambda content: content.fixtures.add(name="bare"), "cell.fixture"),
    "a robot's name": (lambda content: content.fixtures.add(name="left", sphere=0.1), "cell.content"),
    "a name twice": (lambda content: content.fixtures.add(name="post", sphere=0.1), "cell.content"),
    "no name": (lambda content: content.fixtures.add(name="A b", sphere=0.1), "cell.fixture"),
    "millimetres": (lambda content: content.fixtures.add(name="big", sphere=5000.0), "cell.fixture"),
    "negative": (lambda content: content.fixtures.add(name="big", sphere=-1.0), "cell.fixture"),
    "a colour": (lambda content: content.fixtures.add(name="c", sphere=0.1, color="red"), "cell.fixture"),
    "another link": (
        lambda content: content.fixtures.add(name="c", sphere=0.1, ignore=["left/none"]),
        "cell.content",
    ),
    "a mesh that the file does not name": (_mesh, "cell.mesh"),
    "too many": (_many, "cell.too_many"),
}


@pytest.mark.parametrize("name", INVALID)
def test_an_invalid_content_is_refused(tmp_path, name):
    _, file = opened(tmp_path)
    content, _ = changed(file)
    spoil, code = INVALID[name]
    spoil(content)
    with pytest.raises(RefusedError) as error:
        file.describe("left", file.normal("left", content))
    assert error.value.reason.code == code


def test_a_robot_without_a_cell_has_a_floor_but_no_fixture(tmp_path):
    path, file = opened(tmp_path, 'site = "one"\n[[robot]]\nname = "arm"\nmodel = "pt600"\n')
    content, _ = changed(file, "arm")
    content.floor.none = True
    save(file, content, "arm")
    assert tomllib.loads(path.read_text())["robot"][0]["floor"] is False
    content.fixtures.add(name="ball", sphere=0.1)
    with refused(codes.CELL_NO_CELL):
        file.describe("arm", file.normal("arm", content))


def test_values_survive_the_way_through_metres_and_radians(tmp_path):
    text = EXAMPLE.replace("[600.0, 0.0, 100.0] }", "[600.1, -0.7, 1e-3], rpy = [12.3, -45.6, 179.99] }")
    _, file = opened(tmp_path, text)
    content = file.content("left")
    assert not list(changes(content, file.normal("left", content)))
    other, fixtures = changed(file)
    fixtures["workbench"].rpy.x = math.radians(12.4)
    assert (
        summary(changes(content, file.normal("left", other)))
        == "workbench: rpy [12.3, -45.6, 179.99] -> [12.4, -45.6, 179.99]"
    )
