"""Links as GLB: in the link's frame, in metres, coloured, cached."""

import json
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robots.descriptions.description import load, parse
from robots.descriptions.glb import _cached_glb, cache_folder, link_glbs
from robots.kinematics.kinematic_tree import Shape
from robots.schema.errors import ShapeError
from robots.shapes.files.read import read_geometry
from robots.shapes.geometry import Geometry, Material, Part, bounds

BOX = """#VRML V2.0 utf8
Shape { appearance Appearance { material DEF %s Material { diffuseColor 1 0 0 transparency 0.5 } }
  geometry Box { size 100 200 300 } }
Shape { appearance Appearance { material DEF steel Material { diffuseColor 0 1 0 } }
  geometry Sphere { radius 10 } }
"""
ROBOT = """
name = "one"
[base]
mesh = "box.wrl"
mesh_pose = { xyz = [0.0, 0.0, 150.0], rpy = [0.0, 0.0, 90.0] }
color = "#0000ff"
[[joint]]
name = "waist"
a = 0.0
alpha = 0.0
d = 0.0
limits = [-1.0, 1.0]
max_speed = 1.0
max_acceleration = 1.0
max_jerk = 1.0
"""


def document(glb: bytes) -> dict[str, Any]:
    magic, version, length = struct.unpack_from("<4sII", glb)
    assert (magic, version, length) == (b"glTF", 2, len(glb))
    (size,) = struct.unpack_from("<I", glb, 12)
    parsed: dict[str, Any] = json.loads(glb[20 : 20 + size])
    return parsed


def corners(glb: bytes) -> tuple[np.ndarray, np.ndarray]:
    parsed = document(glb)
    used = [
        parsed["accessors"][primitive["attributes"]["POSITION"]]
        for geometry in parsed["meshes"]
        for primitive in geometry["primitives"]
    ]
    return (
        np.min([accessor["min"] for accessor in used], axis=0),
        np.max([accessor["max"] for accessor in used], axis=0),
    )


def one(folder: Path, material: str = "paint") -> dict[str, bytes]:
    (folder / "box.wrl").write_text(BOX % material)
    return link_glbs(parse(ROBOT, folder / "robot.toml"), cache=folder / "cache")


def test_shape_is_scaled_turned_and_shifted_into_the_links_frame(tmp_path: Path) -> None:
    low, high = corners(one(tmp_path)["base"])
    np.testing.assert_allclose([low, high], [[-0.1, -0.05, 0.0], [0.1, 0.05, 0.3]], atol=1e-7)


def test_color_replaces_only_the_paint(tmp_path: Path) -> None:
    materials = {m["name"]: m["pbrMetallicRoughness"] for m in document(one(tmp_path)["base"])["materials"]}
    assert materials["paint"]["baseColorFactor"] == pytest.approx([0, 0, 1, 0.5], abs=0.01)
    assert materials["steel"]["baseColorFactor"] == pytest.approx([0, 1, 0, 1], abs=0.01)


def test_color_replaces_all_without_a_paint_material(tmp_path: Path) -> None:
    materials = document(one(tmp_path, "red")["base"])["materials"]
    assert all(m["pbrMetallicRoughness"]["baseColorFactor"][:3] == [0, 0, 1] for m in materials)


def test_transparent_material_is_blended(tmp_path: Path) -> None:
    materials = {m["name"]: m for m in document(one(tmp_path)["base"])["materials"]}
    assert materials["paint"]["alphaMode"] == "BLEND"
    assert materials["steel"].get("alphaMode", "OPAQUE") == "OPAQUE"


def test_normals_are_transformed_with_the_shape(tmp_path: Path) -> None:
    for geometry in document(one(tmp_path)["base"])["meshes"]:
        assert "NORMAL" in geometry["primitives"][0]["attributes"]


def test_link_without_a_shape_has_no_glb(tmp_path: Path) -> None:
    assert list(one(tmp_path)) == ["base"]


def test_changed_shape_file_or_color_gives_another_glb(tmp_path: Path) -> None:
    first = one(tmp_path)["base"]
    assert one(tmp_path)["base"] == first
    assert one(tmp_path, "red")["base"] != first
    red = parse(ROBOT.replace("#0000ff", "#ff0000"), tmp_path / "robot.toml")
    assert link_glbs(red, cache=tmp_path / "cache")["base"] != first


def test_inlined_file_that_changes_is_noticed(tmp_path: Path) -> None:
    (tmp_path / "box.wrl").write_text('#VRML V2.0 utf8\nInline { url "part.wrl" }')
    description = parse(ROBOT, tmp_path / "robot.toml")
    sizes = []
    for size in ("10 10 10", "20 20 20"):
        (tmp_path / "part.wrl").write_text(f"#VRML V2.0 utf8\nShape {{ geometry Box {{ size {size} }} }}")
        low, high = corners(link_glbs(description, cache=tmp_path / "cache")["base"])
        sizes.append(float((high - low)[0]))
    assert sizes == pytest.approx([0.01, 0.02])


EXTERN = """#VRML V2.0 utf8
EXTERNPROTO P [ ] "part.wrl#P"
P { }
Inline { url [ "first.wrl" "second.wrl" ] }
Shape { geometry Box { size 1 1 1 } }
"""


def test_appearing_and_disappearing_file_changes_the_glb(tmp_path: Path) -> None:
    (tmp_path / "box.wrl").write_text(EXTERN)
    description = parse(ROBOT, tmp_path / "robot.toml")

    def width() -> float:
        low, high = corners(link_glbs(description, cache=tmp_path / "cache")["base"])
        return float((high - low)[0])

    def write(name: str, content: str) -> None:
        (tmp_path / name).write_text(f"#VRML V2.0 utf8\n{content}")

    assert width() == pytest.approx(0.001)
    write("part.wrl", "PROTO P [ ] { Shape { geometry Box { size 20 20 20 } } }")
    assert width() == pytest.approx(0.02)
    write("second.wrl", "Shape { geometry Box { size 30 30 30 } }")
    assert width() == pytest.approx(0.03)
    write("first.wrl", "Shape { geometry Box { size 40 40 40 } }")
    assert width() == pytest.approx(0.04)
    (tmp_path / "first.wrl").unlink()
    assert width() == pytest.approx(0.03)


def test_link_of_several_files_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "box.wrl").write_text('#VRML V2.0 utf8\nInline { url "part.wrl" }')
    (tmp_path / "part.wrl").write_text("#VRML V2.0 utf8\nShape { geometry Box { } }")
    description = parse(ROBOT, tmp_path / "robot.toml")
    first = link_glbs(description, cache=tmp_path / "cache")
    monkeypatch.setattr("robots.descriptions.glb.read_geometry", None)
    assert link_glbs(description, cache=tmp_path / "cache") == first


def test_copied_file_uses_the_files_next_to_the_copy(tmp_path: Path) -> None:
    found = []
    for folder, size in (("a", "10 10 10"), ("b", "20 20 20")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "box.wrl").write_text('#VRML V2.0 utf8\nInline { url "part.wrl" }')
        (tmp_path / folder / "part.wrl").write_text(
            f"#VRML V2.0 utf8\nShape {{ geometry Box {{ size {size} }} }}"
        )
        description = parse(ROBOT, tmp_path / folder / "robot.toml")
        found.append(link_glbs(description, cache=tmp_path / "cache")["base"])
    low, high = corners(found[1])
    assert (high - low)[0] == pytest.approx(0.02)


@pytest.mark.parametrize(
    "change",
    [
        {"colors": np.array([[1.0, 0, 0, 1]] * 3)},
        {"normals": np.array([[0.0, 1, 0]] * 3)},
        {"two_sided": True},
        {"name": "other"},
    ],
    ids=["colors", "normals", "two_sided", "name"],
)
def test_any_change_of_a_generated_shape_changes_its_glb(tmp_path: Path, change: dict[str, Any]) -> None:
    def glb(part: Part) -> bytes:
        shape = Shape(Geometry((part,)), np.eye(4))
        return _cached_glb((shape,), tmp_path)

    part = Part("a", Material(), np.eye(3), np.array([[0.0, 0, 1]] * 3), np.array([[0, 1, 2]]))
    assert glb(part) != glb(replace(part, **change))


@pytest.mark.slow
def test_librarys_meshes_need_no_trimesh(tmp_path: Path) -> None:
    code = (
        "import sys; from robots.descriptions.description import load; "
        "from robots.descriptions.glb import link_glbs; "
        "glbs = link_glbs(load('pt600')); print(len(glbs), 'trimesh' in sys.modules)"
    )
    answers = [
        subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env={"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": ":".join(sys.path)},
        ).stdout.split()
        for _ in range(2)
    ]
    assert answers == [["6", "False"], ["6", "False"]]


def test_cache_that_cannot_be_written_falls_back(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocker))
    assert blocker not in cache_folder().parents


def test_invalid_shape_file_is_reported(tmp_path: Path) -> None:
    (tmp_path / "box.wrl").write_bytes(b"MM\0\0")
    with pytest.raises(ShapeError, match=r"box\.wrl"):
        link_glbs(parse(ROBOT, tmp_path / "robot.toml"), cache=tmp_path / "cache")


def test_glb_has_the_shape_files_shape(tmp_path: Path) -> None:
    description = load("pt600")
    path = description.mesh_path(description.bodies["column"])
    assert path is not None
    low, high = bounds(read_geometry(path))
    glb_low, glb_high = corners(link_glbs(description, cache=tmp_path)["column"])
    np.testing.assert_allclose([glb_low, glb_high], [low / 1000, high / 1000], atol=1e-6)
