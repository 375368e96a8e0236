"""Saving a robot: readable text, and a folder that is complete after any interruption."""

import io
import os
import signal
import subprocess
import sys
import tomllib
import zipfile
from copy import deepcopy
from pathlib import Path

import pytest

from robots.descriptions.description import LIBRARY, load
from robots.descriptions.description_text import description_text
from robots.descriptions.glb import link_geometry, link_glbs
from robots.descriptions.save_description import (
    Saved,
    read_robot,
    refused_path,
    revision_of,
    write_description,
    zip_description,
)
from robots.kinematics.kinematic_tree import tree_of
from robots.schema.errors import DescriptionError, RobotExistsError, SaveError

PT500 = (LIBRARY / "pt500" / "robot.toml").read_text(encoding="utf-8")

SMALL = {
    "name": "one",
    "units": {"length": "mm", "angle": "deg"},
    "base": {"mesh": "meshes/base.wrl", "mesh_pose": {"xyz": [0, 0, 1], "rpy": [0, 0, 90]}},
    "joint": [{"name": "turn", "a": 0, "alpha": 0, "d": 100, "limits": [-90, 90], "link": {"name": "arm"}}],
    "view": {"top": {"eye": [0, 0, 1], "target": [0, 0, 0], "up": [0, 1, 0]}},
    "title": None,
}


def test_description_is_written_like_a_hand_written_file():
    assert description_text(SMALL) == (
        'name = "one"\n'
        'units = { length = "mm", angle = "deg" }\n'
        "\n"
        "[base]\n"
        'mesh = "meshes/base.wrl"\n'
        "mesh_pose = { xyz = [0.0, 0.0, 1.0], rpy = [0.0, 0.0, 90.0] }\n"
        "\n"
        "[[joint]]\n"
        'name = "turn"\n'
        "a = 0.0\n"
        "alpha = 0.0\n"
        "d = 100.0\n"
        "limits = [-90.0, 90.0]\n"
        'link = { name = "arm" }\n'
        "\n"
        "[view.top]\n"
        "eye = [0.0, 0.0, 1.0]\n"
        "target = [0.0, 0.0, 0.0]\n"
        "up = [0.0, 1.0, 0.0]\n"
    )


@pytest.mark.parametrize("robot", ["pt500", "pt600", "puma560"])
def test_library_files_round_trip(robot):
    text = (LIBRARY / robot / "robot.toml").read_text(encoding="utf-8")
    values = tomllib.loads(text)
    assert description_text(values, text) == text
    assert tomllib.loads(description_text(values)) == values


def test_texts_with_quotes_newlines_and_other_alphabets_are_kept():
    values = {"name": "x", "title": 'a "b" \\ \n\t', "provenance": "гибкий 机器人 \x7f"}
    assert tomllib.loads(description_text(values)) == values


def test_comments_stay_with_their_joints_when_rows_move_change_and_go():
    text = PT500.replace("limits = [-110.0, 110.0]", "limits = [-110.0, 110.0]  # hoses")
    values = tomllib.loads(text)
    waist, shoulder, elbow, wrist, _roll = values["joint"]
    values["joint"] = [waist, elbow, deepcopy(shoulder) | {"name": "second"}, wrist]
    elbow["limits"] = [-90, 90]
    values["frame"] = [{"name": "camera", "link": "wrist", "xyz": [0, 0, 1]}]
    del values["tool"]
    written = description_text(values, text)
    assert tomllib.loads(written) == values
    assert written.startswith("# Five rotary joints")
    assert "limits = [-90.0, 90.0]  # hoses\n" in written
    assert written.index("# hoses") < written.index('name = "second"') < written.index('name = "wrist"')
    assert 'name = "roll"' not in written
    assert "[tool]" not in written


def test_file_that_is_not_toml_is_rewritten():
    assert description_text({"name": "x"}, "name = [") == 'name = "x"\n'


# ---------------------------------------------------------------------------- folders


def version(number: int) -> dict:
    return {"name": "arm", "title": f"version {number}"}


def content(number: int) -> bytes:
    return bytes([number]) * 300_000


def assert_whole(folder: Path, numbers) -> None:
    values, files = read_robot(folder / "arm")
    (number,) = (number for number in numbers if values == version(number))
    assert set(files) == {"meshes/a.wrl", f"meshes/{number}.3ds"}
    assert {path.read_bytes() for path in files.values()} == {content(number)}


def save(folder: Path, number: int, **more) -> Saved:
    files = {"meshes/a.wrl": content(number), f"meshes/{number}.3ds": content(number)}
    return write_description(version(number), files, folder, **more)


def test_saved_robot_equals_its_description(tmp_path):
    values, files = read_robot(LIBRARY / "pt500")
    path = write_description(values | {"name": "mine"}, files, tmp_path / "robots").path
    assert path == tmp_path / "robots" / "mine" / "robot.toml"
    assert load(path).joints == load("pt500").joints
    assert read_robot(path.parent)[1].keys() == files.keys()


def test_robot_is_replaced_completely_and_only_on_request(tmp_path):
    save(tmp_path, 1)
    with pytest.raises(RobotExistsError):
        save(tmp_path, 2)
    assert_whole(tmp_path, [1])
    save(tmp_path, 2, overwrite=True)
    assert_whole(tmp_path, [2])
    assert [path.name for path in tmp_path.iterdir()] == ["arm"]


def test_robot_is_replaced_if_its_revision_is_unchanged(tmp_path):
    first = save(tmp_path, 1).revision
    second = save(tmp_path, 2, replaces=first).revision
    assert second == revision_of(tmp_path / "arm") != first
    with pytest.raises(RobotExistsError) as error:
        save(tmp_path, 3, replaces=first)
    assert error.value.changed
    assert_whole(tmp_path, [2])


@pytest.mark.parametrize("change", ["added", "changed", "gone", "renamed", "a link"])
def test_any_change_in_a_folder_changes_its_revision(tmp_path, change):
    before = save(tmp_path, 1).revision
    geometry = tmp_path / "arm" / "meshes" / "a.wrl"
    if change == "added":
        (tmp_path / "arm" / "README.md").write_text("hello")
    elif change == "changed":
        geometry.write_bytes(content(1)[:-1] + b"x")
    elif change == "gone":
        geometry.unlink()
    elif change == "renamed":
        geometry.rename(geometry.with_name("b.wrl"))
    else:
        (tmp_path / "arm" / "link").symlink_to(geometry)
    assert revision_of(tmp_path / "arm") != before


def test_saving_follows_a_symbolic_link(tmp_path):
    save(tmp_path / "elsewhere", 1)
    (tmp_path / "robots").mkdir()
    (tmp_path / "robots" / "arm").symlink_to(tmp_path / "elsewhere" / "arm")
    for number in (2, 3):
        save(tmp_path / "robots", number, overwrite=True)
        assert (tmp_path / "robots" / "arm").is_symlink()
        assert_whole(tmp_path / "elsewhere", [number])
    assert [path.name for path in (tmp_path / "elsewhere").iterdir()] == ["arm"]


def test_leftover_link_or_file_does_not_prevent_saving(tmp_path):
    save(tmp_path, 1)
    (tmp_path / ".arm.0000.saving").symlink_to(tmp_path / "arm")
    (tmp_path / ".arm.0001.saving").write_text("")
    save(tmp_path, 2, overwrite=True)
    assert_whole(tmp_path, [2])
    assert [path.name for path in tmp_path.iterdir()] == ["arm"]


def test_a_file_called_robot_toml_is_neither_saved_nor_zipped_in_place_of_the_draft(tmp_path):
    files = {"robot.toml": b'name = "another"'}
    path = write_description(version(1), files, tmp_path).path
    assert tomllib.loads(path.read_text()) == version(1)
    with zipfile.ZipFile(io.BytesIO(zip_description(version(1), files))) as zipped:
        assert zipped.namelist() == ["arm/robot.toml"]
        assert tomllib.loads(zipped.read("arm/robot.toml").decode()) == version(1)


def test_folder_without_a_robot_is_not_replaced(tmp_path):
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "thesis.txt").write_text("years of work")
    with pytest.raises(SaveError, match="is not a robot's folder"):
        save(tmp_path, 1, overwrite=True)
    assert (tmp_path / "arm" / "thesis.txt").read_text() == "years of work"


@pytest.mark.parametrize(
    "path",
    [
        "",
        "/etc/x.wrl",
        "../x.wrl",
        "a/../../x",
        "a//b",
        "./a",
        "a/",
        "c:/x",
        "a\\b",
        "a\0b",
        "a\nb",
        "x" * 300,
    ],
)
def test_a_path_that_leads_out_of_the_folder_is_refused(path, tmp_path):
    assert refused_path(path)
    with pytest.raises(DescriptionError):
        write_description(version(1), {path: b""}, tmp_path / "robots")
    with pytest.raises(DescriptionError):
        zip_description(version(1), {path: b""})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", [None, "", "../x", "Arm", "a b", ".arm", 5, "a" * 101])
def test_invalid_robot_name_is_refused(name, tmp_path):
    with pytest.raises(DescriptionError, match="name"):
        write_description({"name": name}, {}, tmp_path)


def test_file_in_place_of_a_folder_is_refused_without_leftovers(tmp_path):
    with pytest.raises(SaveError):
        write_description(version(1), {"a": b"1", "a/b": b"2"}, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_zip_has_the_same_folder_and_is_reproducible():
    files = {"meshes/a.wrl": b"mesh"}
    archive = zip_description(version(1), files)
    assert archive == zip_description(version(1), files)
    with zipfile.ZipFile(io.BytesIO(archive)) as zipped:
        assert zipped.namelist() == ["arm/robot.toml", "arm/meshes/a.wrl"]
        assert zipped.read("arm/meshes/a.wrl") == b"mesh"
        assert tomllib.loads(zipped.read("arm/robot.toml").decode()) == version(1)


_SAVES_FOR_EVER = """
import itertools, sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
from tests.robots.test_robot_save import save
print("ready", flush=True)
for number in itertools.cycle([1, 2]):
    save(Path(sys.argv[1]), number, overwrite=True)
"""


@pytest.mark.slow
def test_kill_at_any_time_leaves_one_complete_robot(tmp_path):
    save(tmp_path, 1)
    seen = set()
    for round_ in range(5):
        process = subprocess.Popen(
            [sys.executable, "-c", _SAVES_FOR_EVER, str(tmp_path), str(Path(__file__).parents[2])],
            stdout=subprocess.PIPE,
        )
        try:
            assert process.stdout.readline() == b"ready\n"
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(0.02 + 0.0183 * round_)
        finally:
            process.send_signal(signal.SIGKILL)
            process.communicate()
        assert_whole(tmp_path, [1, 2])
        seen |= {path.suffix for path in tmp_path.iterdir()}
    assert seen <= {"", ".saving"}
    save(tmp_path, 3, overwrite=True)
    assert_whole(tmp_path, [3])
    assert [path.name for path in tmp_path.iterdir()] == ["arm"], "what the killed ones left is gone"


@pytest.fixture
def small_disk(tmp_path):
    if os.getuid() != 0:
        pytest.skip("only root can mount a small disk")
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)]
    if subprocess.run(mount, capture_output=True).returncode != 0:
        pytest.skip("this machine mounts no tmpfs")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.slow
def test_full_disk_is_reported_and_the_old_robot_stays(small_disk):
    save(small_disk, 1)
    with pytest.raises(SaveError, match="arm: not saved, No space left on device"):
        save(small_disk, 2, overwrite=True)
    assert_whole(small_disk, [1])
    assert [path.name for path in small_disk.iterdir()] == ["arm"]


BOX = "#VRML V2.0 utf8\nShape { geometry Box { } }\n"


def write_inlining_robot(folder, address):
    """Write a robot with a box as its base, which inlines a file."""
    folder.mkdir()
    (folder / "base.wrl").write_text(f'{BOX}Inline {{ url "{address}" }}\n')
    values, _ = read_robot(LIBRARY / "pt500")
    rows = [row | {"link": {}} for row in values["joint"]]
    values |= {"base": {"mesh": "base.wrl"}, "joint": rows}
    (folder / "robot.toml").write_text(description_text(values))


@pytest.mark.parametrize("address", ["../outside.wrl", "{folder}/outside.wrl", "link.wrl"])
def test_shape_reads_no_file_outside_the_robots_folder(tmp_path, address):
    (tmp_path / "outside.wrl").write_text(BOX)
    robot = tmp_path / "arm"
    write_inlining_robot(robot, address.format(folder=tmp_path))
    (robot / "link.wrl").symlink_to(tmp_path / "outside.wrl")
    (shape,) = tree_of(load(robot)).links[0].shapes
    geometry = link_geometry([shape])
    assert geometry.triangle_count == 12
    assert (
        "no such file in the folder 'arm'; other folders are not read; it is left out" in geometry.warnings[0]
    )


@pytest.mark.parametrize("confined", [False, True])
def test_vrml_robot_reads_no_file_outside_its_folder(tmp_path, confined):
    (tmp_path / "outside.wrl").write_text(BOX)
    robot = tmp_path / "arm" / "arm.wrl"
    robot.parent.mkdir()
    joint = (
        'Joint { jointType "rotate" jointId 0 children Segment { children Inline { url "../outside.wrl" } } }'
    )
    robot.write_text("#VRML V2.0 utf8\n" + joint)
    description = load(robot, confined=confined)
    assert not any(link.shapes for link in tree_of(description).links)
    note_text = "no such file in the folder 'arm'; other folders are not read"
    assert any(note_text in note for note in description.robot.notes)


def test_confined_robot_reads_no_file_of_another_folder(tmp_path):
    (tmp_path / "package.xml").touch()  # files of the robot's package may be read, unless reading is confined
    (tmp_path / "outside.wrl").write_text(BOX)
    robot = tmp_path / "arm"
    write_inlining_robot(robot, f"{tmp_path}/outside.wrl")
    cache = tmp_path / "cache"
    # The cache does not confuse this GLB with that of a robot that is not confined.
    free = link_glbs(load(robot), cache=cache)["base"]
    confined = link_glbs(load(robot, confined=True), cache=cache)["base"]
    (robot / "base.wrl").write_text(f'{BOX}Inline {{ url "{tmp_path}/none.wrl" }}\n')
    assert len(confined) < len(free)
    assert link_glbs(load(robot), cache=cache)["base"] == confined


def test_confined_description_names_no_file_of_another_folder(tmp_path):
    (tmp_path / "outside.wrl").write_text(BOX)
    (tmp_path / "arm").mkdir()
    text = PT500.replace("meshes/base.wrl", "../outside.wrl")
    (tmp_path / "arm" / "robot.toml").write_text(text)
    with pytest.raises(DescriptionError) as error:
        load(tmp_path / "arm", confined=True)
    assert any("must be in the description's folder" in text for text in error.value.problems)


@pytest.mark.parametrize(
    "value", ["9" * 5000, "0x" + "f" * 5000, "[" * 2000 + "]" * 2000], ids=["digits", "hex", "nested"]
)
def test_number_of_thousands_of_digits_is_reported(tmp_path, value):
    (tmp_path / "robot.toml").write_text(f"{PT500}\nodd = {value}\n".replace("\nodd", "\n[tool2]\nodd"))
    (tmp_path / "other.toml").write_text(f"name = {value}\n")
    for name in ("robot.toml", "other.toml"):
        with pytest.raises(DescriptionError):
            load(tmp_path / name)
