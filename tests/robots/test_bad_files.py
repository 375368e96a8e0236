"""Files that need more memory than their size suggests, or that break other readers."""

import json
import struct
from base64 import b64encode
from pathlib import Path

import ezdxf
import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files import step
from robots.shapes.files.read import read_geometry

FACES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
DAE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.001"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="9">0 0 0 1 0 0 0 1 0
</float_array><technique_common><accessor source="#a" count="3" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices><triangles count="1">
<input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles></mesh></geometry>
</library_geometries>
NODES<library_visual_scenes><visual_scene id="s"><node id="n">INSTANCE</node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def dae(nodes: str = "", instance: str = '<instance_geometry url="#g"/>') -> str:
    return DAE.replace("NODES", nodes).replace("INSTANCE", instance)


def written(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_obj_and_collada_in_other_encodings_are_read(tmp_path: Path, encoding: str) -> None:
    assert read_geometry(written(tmp_path, "a.obj", FACES.encode(encoding))).triangle_count == 1
    text = dae().replace("utf-8", "utf-16") if "16" in encoding else dae()
    geometry = read_geometry(written(tmp_path, "a.dae", text.encode(encoding)))
    assert (geometry.triangle_count, geometry.unit_m, geometry.up) == (1, 0.001, "z")


def test_a_collada_file_may_begin_with_an_empty_line(tmp_path: Path) -> None:
    geometry = read_geometry(written(tmp_path, "a.dae", "  \n" + dae()))
    assert (geometry.triangle_count, geometry.unit_m) == (1, 0.001)


def test_doctype_in_utf16_is_rejected(tmp_path: Path) -> None:
    bomb = '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE COLLADA [<!ENTITY a "a">]><COLLADA>&a;</COLLADA>'
    with pytest.raises(ShapeError, match="DOCTYPE"):
        read_geometry(written(tmp_path, "a.dae", bomb.encode("utf-16")))


def test_obj_faces_may_have_negative_indices(tmp_path: Path) -> None:
    first = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf -3//-1 -2//-1 -1//-1 # -9\n"
    text = first + "v 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 5 \\\n -1\n"
    geometry = read_geometry(written(tmp_path, "a.obj", text))
    corners = {
        tuple(point) for part in geometry.parts for point in part.vertices[part.triangles[-1]].tolist()
    }
    assert geometry.triangle_count == 2
    assert corners == {(5, 0, 0), (6, 0, 0), (5, 1, 0)}


def test_negative_index_before_the_first_vertex_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="line 4: a face uses vertex -9; there are 3"):
        read_geometry(written(tmp_path, "a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -9 -2 -1\n"))


def test_obj_of_thousands_of_materials_is_drawn_grey(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "".join(f"usemtl m{each}\nf 1 2 3\n" for each in range(2500))
    geometry = read_geometry(written(tmp_path, "a.obj", text))
    assert geometry.triangle_count == 2500
    assert len(geometry.parts) == 1
    assert "2500 materials" in geometry.warnings[0]


def test_collada_with_billions_of_nested_instances_is_rejected(tmp_path: Path) -> None:
    nodes = "".join(
        f'<node id="n{each}">' + f'<instance_node url="#n{each - 1}"/>' * 10 + "</node>"
        for each in range(1, 10)
    )
    library = f'<library_nodes><node id="n0"><instance_geometry url="#g"/></node>{nodes}</library_nodes>'
    with pytest.raises(ShapeError, match="1000000000 instances"):
        read_geometry(written(tmp_path, "a.dae", dae(library, '<instance_node url="#n9"/>')))
    ring = '<library_nodes><node id="r"><instance_node url="#r"/></node></library_nodes>'
    with pytest.raises(ShapeError, match="contains itself"):
        read_geometry(written(tmp_path, "a.dae", dae(ring, '<instance_node url="#r"/>')))
    thrice = read_geometry(written(tmp_path, "b.dae", dae(library, '<instance_node url="#n1"/>')))
    assert thrice.triangle_count == 10


def test_gltf_with_too_many_uses_of_a_shape_is_rejected(tmp_path: Path) -> None:
    data = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0) * 1000
    document = {
        "asset": {"version": "2.0"},
        "buffers": [
            {
                "byteLength": len(data),
                "uri": "data:application/octet-stream;base64," + b64encode(data).decode(),
            }
        ],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3000, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}] * 200}],
        "nodes": [{"mesh": 0}] * 200,
        "scenes": [{"nodes": list(range(200))}],
        "scene": 0,
    }
    with pytest.raises(ShapeError, match="draws 120000000 points"):
        read_geometry(written(tmp_path, "a.gltf", json.dumps(document)))


def test_invalid_dxf_entity_is_omitted_with_a_warning(tmp_path: Path) -> None:
    drawing = ezdxf.new()
    space = drawing.modelspace()
    space.add_line((0, 0), (1, 0))
    spline = space.add_rational_spline([(0, 0), (1, 2), (2, 0), (3, 1)], weights=[1, 2, 1, 1], degree=3)
    spline.knots = [0.0, 1.0]
    space.add_line((0, 5), (1, 5))
    path = tmp_path / "a.dxf"
    drawing.saveas(path)
    geometry = read_geometry(path)
    (wire,) = geometry.wires
    assert len(wire.vertices) == 4
    (warning,) = geometry.warnings
    assert warning.startswith(f"SPLINE {spline.dxf.handle} left out: it is broken")


@pytest.mark.parametrize("kind", ["ACAD_TABLE", "acad_table"])
def test_dxf_table_is_omitted_and_counted(tmp_path: Path, kind: str) -> None:
    drawing = ezdxf.new()
    drawing.modelspace().add_line((0, 0), (1, 0))
    path = tmp_path / "a.dxf"
    drawing.saveas(path)
    before, line, after = path.read_text().partition("  0\nLINE\n")
    assert line
    table = f"  0\n{kind}\n  5\nFFF1\n100\nAcDbEntity\n  8\n0\n100\nAcDbBlockReference\n  2\n*T1\n"
    path.write_text(f"{before}{table}{line}{after}")
    geometry = read_geometry(path)
    assert len(geometry.wires) == 1
    assert geometry.warnings == (f"left out: 1 {kind}",)


def test_step_that_needs_too_much_memory_is_rejected_with_that_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = step.subprocess.CompletedProcess([], 0, b"", b"")
    monkeypatch.setattr(step.subprocess, "run", lambda *_, **__: done)
    file = written(tmp_path, "a.step", "ISO-10303-21;\n")
    for status in (step._OUT_OF_MEMORY, -6):
        done.returncode = status
        with pytest.raises(ShapeError, match="needs more than 6 GB of memory to read"):
            read_geometry(file)
    done.returncode = 1
    with pytest.raises(ShapeError, match="found no STEP model"):
        read_geometry(file)


def test_obj_texture_and_normal_indices_may_be_negative(tmp_path: Path) -> None:
    # Like trimesh's models/negative_indices.obj, with a second object.
    points = "".join(f"v {x} {y} {z}\n" for x in (1, -1) for y in (1, -1) for z in (-1, 1))
    rest = "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n"
    faces = ["f -4/-3/-1 -2/-2/-1 -1/-1/-1 -3/-1/-1\n", "f -8/-3/-1 -7/-2/-1 -5/-1/-1\n"]
    text = "".join(f"o part{each}\n{points}{rest}usemtl m\ns off\n{''.join(faces)}" for each in range(2))
    geometry = read_geometry(written(tmp_path, "a.obj", text))
    corners = {tuple(p) for part in geometry.parts for p in part.vertices[np.unique(part.triangles)].tolist()}
    assert geometry.triangle_count == 6
    assert corners == {(x, y, z) for x in (1, -1) for y in (1, -1) for z in (1, -1)} - {(1, -1, -1)}
