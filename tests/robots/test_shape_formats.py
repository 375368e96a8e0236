"""STL, OBJ, PLY, DAE and glTF, from files written by hand."""

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files.read import read_geometry
from robots.shapes.geometry import Geometry, bounds

ASCII_STL = """solid one
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 1 1 0
endloop
endfacet
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 0 0 0
vertex 1 1 0
endloop
endfacet
endsolid one
solid two
facet normal 0 0 1
outer loop
vertex 5 0 0
vertex 1 0 0
vertex 1 1 0
endloop
endfacet
endsolid two
"""
OBJ = """mtllib a.mtl
o one
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
v 0 0 2
usemtl red
f 1 2 3 4
usemtl glass
f 1 2 5
f 1 1 -3
l 1 2 3
"""
MTL = """newmtl red
Kd 1 0 0
Ks 1 1 1
Ns 64
newmtl glass
Kd 0 0 1
d 0.25
map_Kd wood.png
"""
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
element face 1
property list uchar int vertex_indices
end_header
0 0 0 255 0 0
1 0 0 0 255 0
1 1 0 0 0 255
0 1 0 255 255 255
4 0 1 2 3
"""
DAE = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><lambert><diffuse>
<color>0.2 0.4 0.6 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m" name="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common>
<accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="1" material="m"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><translate>10 20 30</translate>
<instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="m" target="#m"/></technique_common></bind_material></instance_geometry>
</node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""


def read(folder: Path, name: str, content: str | bytes) -> Geometry:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_geometry(path)


def binary_stl(*triangles: tuple[tuple[float, ...], ...], header: bytes = b"", count: int = -1) -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 1, *sum(triangle, ()), 0) for triangle in triangles)
    return header.ljust(80) + struct.pack("<I", len(triangles) if count < 0 else count) + rows


TRIANGLE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def test_text_stl_keeps_all_facets_and_solids(tmp_path: Path) -> None:
    geometry = read(tmp_path, "a.stl", ASCII_STL)
    assert [(part.name, len(part.triangles)) for part in geometry.parts] == [("one", 2), ("two", 1)]
    np.testing.assert_array_equal(bounds(geometry), [[0, 0, 0], [5, 1, 0]])
    assert (geometry.unit_m, geometry.up) == (None, "")


@pytest.mark.parametrize("header", [b"", b"solid of a careless program"])
def test_binary_stl_is_read_whatever_its_header(tmp_path: Path, header: bytes) -> None:
    geometry = read(tmp_path, "a.stl", binary_stl(TRIANGLE, TRIANGLE, header=header))
    assert geometry.triangle_count == 2  # twice the same: both are the file's
    np.testing.assert_allclose(geometry.parts[0].normals[geometry.parts[0].triangles[0]], [[0, 0, 1]] * 3)


def test_obj_keeps_polygons_materials_and_degenerate_faces(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text(MTL)
    geometry = read(tmp_path, "a.obj", OBJ)
    found = {part.material.name: part for part in geometry.parts}
    assert {name: len(part.triangles) for name, part in found.items()} == {"red": 2, "glass": 2}
    assert found["red"].material.diffuse == (1.0, 0.0, 0.0)
    assert found["red"].material.shininess == 0.5
    assert found["glass"].material.transparency == 0.75
    assert found["glass"].material.texture == "wood.png"
    assert geometry.warnings == (
        "1 lines or points are left out",
        "textures are kept by name, not drawn: wood.png",
    )
    assert geometry.files == (tmp_path / "a.mtl", tmp_path / "wood.png")


def test_obj_without_its_materials_is_grey_with_a_warning(tmp_path: Path) -> None:
    geometry = read(tmp_path, "a.obj", OBJ)
    assert geometry.triangle_count == 4
    assert geometry.warnings[0] == "materials: no file 'a.mtl' in this file's folder; drawn grey"


def test_material_file_above_the_files_folder_counts_as_missing(tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_text(MTL)
    inner = tmp_path / "inner"
    inner.mkdir()
    geometry = read(inner, "a.obj", OBJ.replace("a.mtl", "../a.mtl"))
    assert geometry.warnings[0] == "materials: no file '../a.mtl' in this file's folder; drawn grey"
    assert all(part.material.diffuse != (1.0, 0.0, 0.0) for part in geometry.parts)


def test_ply_gives_colours_of_vertices(tmp_path: Path) -> None:
    (part,) = read(tmp_path, "a.ply", PLY).parts
    assert part.colors is not None
    at = {tuple(v): tuple(c) for v, c in zip(part.vertices.tolist(), part.colors.tolist(), strict=True)}
    assert at == {
        (0, 0, 0): (1, 0, 0, 1),
        (1, 0, 0): (0, 1, 0, 1),
        (1, 1, 0): (0, 0, 1, 1),
        (0, 1, 0): (1, 1, 1, 1),
    }
    assert len(part.triangles) == 2


def test_ply_of_points_only_is_a_wire(tmp_path: Path) -> None:
    text = PLY[: PLY.index("element face")] + "end_header\n" + "0 0 0 255 0 0\n" * 4
    geometry = read(tmp_path, "a.ply", text)
    assert geometry.triangle_count == 0
    assert geometry.wires[0].vertices.shape == (4, 3)
    assert geometry.wires[0].colors is not None
    assert geometry.wires[0].colors[0].tolist() == [1, 0, 0, 1]


def test_dae_is_placed_by_its_nodes_in_its_own_unit(tmp_path: Path) -> None:
    geometry = read(tmp_path, "a.dae", DAE)
    np.testing.assert_allclose(bounds(geometry), [[10, 20, 30], [11, 21, 30]])
    assert geometry.parts[0].material.diffuse == pytest.approx((0.2, 0.4, 0.6))
    assert (geometry.unit_m, geometry.up) == (0.001, "z")


def gltf(**more: Any) -> dict[str, Any]:
    corners = np.array(TRIANGLE, dtype="<f4").tobytes()
    colors = np.array([[1, 0, 0, 1], [0, 0.214, 0, 1], [0, 0, 1, 0.5]], dtype="<f4").tobytes()
    data = base64.b64encode(corners + colors).decode()
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "scale": [2, 2, 2]}, {"mesh": 0, "translation": [0, 0, 1]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "material": 0}]}],
        "materials": [
            {
                "name": "wood",
                "doubleSided": True,
                "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}},
            }
        ],
        "textures": [{"source": 0}],
        "images": [{"uri": "wood.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC4"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 36},
            {"buffer": 0, "byteOffset": 36, "byteLength": 48},
        ],
        "buffers": [{"byteLength": 84, "uri": f"data:application/octet-stream;base64,{data}"}],
        **more,
    }


def test_gltf_is_placed_by_its_nodes_with_its_vertices_colours_and_textures_name(tmp_path: Path) -> None:
    geometry = read(tmp_path, "a.gltf", json.dumps(gltf()))
    np.testing.assert_allclose(bounds(geometry), [[0, 0, 2], [2, 2, 2]])
    (part,) = geometry.parts
    assert part.two_sided
    assert part.material.texture == "wood.png"
    assert part.colors is not None
    green = part.colors[np.argmax(part.colors[:, 1])]
    assert green == pytest.approx([0, 0.5, 0, 1], abs=0.01)  # 0.214 of linear light
    assert (geometry.unit_m, geometry.up) == (1.0, "y")


def test_gltf_reads_its_buffer_from_its_folder_or_names_the_missing_file(tmp_path: Path) -> None:
    document = gltf()
    data = base64.b64decode(document["buffers"][0]["uri"].split(",")[1])
    document["buffers"][0]["uri"] = "a.bin"
    with pytest.raises(ShapeError, match=r"buffer 'a\.bin': no such file in this folder"):
        read(tmp_path, "a.gltf", json.dumps(document))
    (tmp_path / "a.bin").write_bytes(data)
    geometry = read(tmp_path, "a.gltf", json.dumps(document))
    assert geometry.triangle_count == 1
    assert geometry.files == (tmp_path / "a.bin", tmp_path / "wood.png")


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.stl", b"", "is empty"),
        ("a.stl", b"\0" * 50, "is not an STL"),
        ("a.stl", binary_stl(TRIANGLE, count=4_000_000_000), "byte 80: declares 4000000000 triangles"),
        ("a.stl", binary_stl(((float("nan"), 0.0, 0.0), *TRIANGLE[1:])), "non-finite"),
        ("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n", "is not an STL"),
        ("a.obj", "v 0 0 0\nf 1 2 3\n", "cannot be read as OBJ"),
        (
            "a.obj",
            "v 0 0 0\nf 1 1//1 14141414/2\n",
            "line 2: a face uses vertex 14141414; there are at most 1",
        ),
        ("a.obj", "v 0 0 zero\nv 0 0 1\nv 1 1 1\nf 1 2 3\n", "cannot be read as OBJ"),
        ("a.ply", PLY.replace("vertex 4", "vertex 4000000000"), "line 4: declares 4000000000 rows"),
        ("a.ply", PLY.replace("4 0 1 2 3", "4 0 1 2 9"), "uses vertex 9; there are 4"),
        ("a.ply", PLY[:150], "is not a PLY"),
        ("a.dae", DAE[:600], "cannot be read as DAE"),
        ("a.dae", DAE.replace("<asset>", "<!DOCTYPE x><asset>"), "has a DOCTYPE"),
        ("a.glb", b"glTF\2\0\0\0", "is not a GLB"),
        ("a.glb", b"glTF" + struct.pack("<4I", 2, 99, 99, 0x4E4F534A), "is truncated"),
        ("a.gltf", "{", "its JSON is invalid"),
        (
            "a.gltf",
            json.dumps(gltf(extensionsRequired=["KHR_draco_mesh_compression"])),
            "without compression",
        ),
        ("a.gltf", json.dumps(gltf(nodes=[{"mesh": 0, "children": [0]}])), "is its own ancestor"),
        (
            "a.gltf",
            json.dumps(gltf(accessors=[{"componentType": 5126, "count": 4_000_000_000, "type": "VEC3"}])),
            "draws 4000000000 points",
        ),
        ("a.xyz", b"0 0 0\n", "ending '.xyz' is not supported; use .wrl"),
    ],
)
def test_error_of_an_invalid_file_is_one_line(
    tmp_path: Path, name: str, content: str | bytes, expected: str
) -> None:
    with pytest.raises(ShapeError) as caught:
        read(tmp_path, name, content)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.obj", ASCII_STL, "ends in '.obj' but contains STL; read as that"),
        ("a.stl", PLY, "ends in '.stl' but contains PLY; read as that"),
        (
            "a.3ds",
            "#VRML V2.0 utf8\nShape { geometry Box { } }",
            "ends in '.3ds' but contains WRL; read as that",
        ),
    ],
)
def test_wrong_extension_causes_a_warning(tmp_path: Path, name: str, content: str, expected: str) -> None:
    geometry = read(tmp_path, name, content)
    assert geometry.triangle_count > 0
    assert geometry.warnings[0] == expected
