"""The VRML 2.0 reader: the paper's sample, real files, and broken ones."""

import json
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from robots.errors import MeshError
from robots.meshes.mesh import bounds
from robots.meshes.read import read_mesh
from robots.meshes.vrml import read_vrml

TESTDATA = Path(__file__).resolve().parents[2].parent / "shared" / "testdata"

# As printed: a blank in the header, a name that begins with a digit, a sign apart from its digits.
PAPER_SAMPLE = """# VRML V2.0 utf8
Shape {
  appearance Appearance { material Material { diffuseColor 0.7 0.7 0.7  transparency 0 } }
  geometry DEF 1-FACES IndexedFaceSet {
    ccw TRUE
    solid TRUE
    coord DEF 1-COORD Coordinate { point [
      0 30.8 0, - 25.08 -6.161 13.86, 25.08 -6.161 13.86, 25.08 -6.161 -13.86,
      -25.08 -6.161 -13.86, 0 -6.161 0 ] }
    coordIndex [ 0, 1, 2, -1, 0, 2, 3, -1, 0, 3, 4, -1, 0, 4, 1, -1,
                 1, 5, 2, -1, 2, 5, 3, -1, 3, 5, 4, -1, 4, 5, 1, -1 ]
  }
}
"""
SQUARE = """geometry IndexedFaceSet { coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] }
  coordIndex [ 0 1 2 3 ] }"""


def write(folder: Path, text: str, name: str = "a.wrl") -> Path:
    path = folder / name
    path.write_text(text if text.startswith(("#", "\ufeff")) else f"#VRML V2.0 utf8\n{text}")
    return path


def test_papers_sample_is_read_with_warnings(tmp_path: Path) -> None:
    mesh = read_vrml(write(tmp_path, PAPER_SAMPLE))
    low, high = bounds(mesh)
    assert mesh.triangle_count == 8
    assert low.tolist() == [-25.08, -6.161, -13.86]
    assert high.tolist() == [25.08, 30.8, 13.86]
    assert mesh.parts[0].material.diffuse == (0.7, 0.7, 0.7)
    assert [warning.split(":")[0] for warning in mesh.warnings] == ["line 1", "line 4", "line 8"]


def expected_files(folder: str) -> list[dict[str, object]]:
    table = TESTDATA / "expected.json"
    rows = json.loads(table.read_text()) if table.is_file() else []
    return [row for row in rows if row["file"].startswith(folder)]


@pytest.mark.skipif(not TESTDATA.is_dir(), reason="the shared test data is not beside the checkout")
@pytest.mark.parametrize("expected", expected_files(""), ids=lambda row: str(row["file"]))
def test_real_file_has_the_triangles_and_bounds_that_other_readers_agree_on(
    expected: dict[str, object],
) -> None:
    mesh = read_mesh(TESTDATA / str(expected["file"]))
    low, high = bounds(mesh)
    assert mesh.triangle_count == expected["triangles"]
    np.testing.assert_allclose(low, expected["min"], atol=1e-5)
    np.testing.assert_allclose(high, expected["max"], atol=1e-5)
    assert mesh.warnings == ()


def test_polygon_becomes_a_fan(tmp_path: Path) -> None:
    (part,) = read_vrml(write(tmp_path, f"Shape {{ {SQUARE} }}")).parts
    assert len(part.triangles) == 2
    np.testing.assert_allclose(part.normals, [[0, 0, 1]] * 4)


def test_clockwise_faces_are_turned_over(tmp_path: Path) -> None:
    text = f"Shape {{ {SQUARE} }}".replace("coordIndex", "ccw FALSE coordIndex")
    (part,) = read_vrml(write(tmp_path, text)).parts
    np.testing.assert_allclose(part.normals, [[0, 0, -1]] * 4)
    a, b, c = part.vertices[part.triangles[0]]
    assert np.cross(b - a, c - a)[2] < 0


def test_mirroring_scale_keeps_faces_outwards(tmp_path: Path) -> None:
    (part,) = read_vrml(
        write(tmp_path, "Transform { scale -1 1 1 children Shape { geometry Box { } } }")
    ).parts
    assert volume(part.vertices, part.triangles) == pytest.approx(8.0)
    assert outwards(part.vertices, part.normals, part.triangles)


def volume(vertices: np.ndarray, triangles: np.ndarray) -> float:
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def outwards(vertices: np.ndarray, normals: np.ndarray, triangles: np.ndarray) -> bool:
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    return bool((np.einsum("ij,ikj->ik", facing, normals[triangles]) > 0).all())


@pytest.mark.parametrize(
    ("geometry", "expected", "tolerance"),
    [
        ("Box { size 1 2 3 }", 6.0, 1e-9),
        ("Sphere { radius 2 }", 4 / 3 * np.pi * 8, 0.6),
        ("Cylinder { radius 1 height 3 }", 3 * np.pi, 0.1),
        ("Cone { bottomRadius 1 height 3 }", np.pi, 0.05),
    ],
)
def test_solid_of_the_standard_has_its_volume(
    tmp_path: Path, geometry: str, expected: float, tolerance: float
) -> None:
    (part,) = read_vrml(write(tmp_path, f"Shape {{ geometry {geometry} }}")).parts
    assert volume(part.vertices, part.triangles) == pytest.approx(expected, abs=tolerance)
    assert outwards(part.vertices, part.normals, part.triangles)


def test_cylinder_stands_along_y(tmp_path: Path) -> None:
    low, high = bounds(read_vrml(write(tmp_path, "Shape { geometry Cylinder { radius 1 height 6 } }")))
    np.testing.assert_allclose(high - low, [2, 6, 2], atol=1e-6)


def test_concave_polygon_is_cut_inside_itself(tmp_path: Path) -> None:
    # An L of area 3; a fan from its first corner would cover what is not there.
    text = """Shape { geometry IndexedFaceSet { convex FALSE
      coord Coordinate { point [ 2 1 0, 1 1 0, 1 2 0, 0 2 0, 0 0 0, 2 0 0 ] }
      coordIndex [ 0 1 2 3 4 5 -1 ] } }"""
    (part,) = read_vrml(write(tmp_path, text)).parts
    a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert len(areas) == 4
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(3.0)


def test_crease_angle_makes_gentle_edges_smooth(tmp_path: Path) -> None:
    # A roof of 20 degrees.
    text = """Shape { geometry IndexedFaceSet { %s coord Coordinate { point [
      -1 0 0, -1 1 0, 0 0 0.176, 0 1 0.176, 1 0 0, 1 1 0 ] } coordIndex [ 0 2 3 1 -1 2 4 5 3 -1 ] } }"""
    (flat,) = read_vrml(write(tmp_path, text % "")).parts
    (smooth,) = read_vrml(write(tmp_path, text % "creaseAngle 0.5")).parts
    assert len(flat.vertices) == 8
    assert len(smooth.vertices) == 6


@pytest.mark.parametrize(
    ("per_vertex", "index", "first"),
    [("TRUE", "", [0, 0, 1]), ("TRUE", "normalIndex [ 1 0 0 0 -1 ]", [1, 0, 0]), ("FALSE", "", [0, 0, 1])],
)
def test_given_normals_are_kept(tmp_path: Path, per_vertex: str, index: str, first: list[int]) -> None:
    text = f"""Shape {{ geometry IndexedFaceSet {{ coord Coordinate {{ point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] }}
      normal Normal {{ vector [ 0 0 1, 1 0 0, 1 0 0, 1 0 0 ] }} normalPerVertex {per_vertex} {index}
      coordIndex [ 0 1 2 3 -1 ] }} }}"""
    (part,) = read_vrml(write(tmp_path, text)).parts
    corner = int(np.flatnonzero((part.vertices == 0).all(axis=1))[0])
    assert part.normals[corner].tolist() == first


def test_transform_scales_then_turns_then_shifts(tmp_path: Path) -> None:
    text = """Transform { translation 10 0 0 rotation 0 0 1 1.5707963267948966 scale 2 1 1
      children Shape { geometry Box { size 2 2 2 } } }"""
    low, high = bounds(read_vrml(write(tmp_path, text)))
    np.testing.assert_allclose([low, high], [[9, -2, -1], [11, 2, 1]], atol=1e-12)


def test_center_and_scale_orientation_follow_the_standard(tmp_path: Path) -> None:
    # Stretched along the diagonal about (1, 1, 0): the corner (2, 2) goes to (3, 3).
    text = """Transform { center 1 1 0 scaleOrientation 0 0 1 0.7853981633974483 scale 2 1 1 children
      Shape { geometry IndexedFaceSet {
        coord Coordinate { point [ 0 0 0, 2 0 0, 2 2 0 ] } coordIndex [ 0 1 2 ] } } }"""
    low, high = bounds(read_vrml(write(tmp_path, text)))
    np.testing.assert_allclose([low, high], [[-1, -1, 0], [3, 3, 0]], atol=1e-12)


def test_used_node_is_drawn_where_it_is_used(tmp_path: Path) -> None:
    text = f"""DEF S Shape {{ {SQUARE} }} Transform {{ translation 5 0 0 children [ USE S, USE S ] }}"""
    mesh = read_vrml(write(tmp_path, text))
    assert mesh.triangle_count == 6
    assert bounds(mesh)[1].tolist() == [6, 1, 0]


def test_switch_draws_its_choice_and_lod_its_first_level(tmp_path: Path) -> None:
    shape = f"Shape {{ {SQUARE} }}"
    cases = {
        f"Switch {{ choice [ {shape} {shape} ] }}": 0,
        f"Switch {{ whichChoice 1 choice [ {shape} Group {{ children [ {shape} {shape} ] }} ] }}": 4,
        f"LOD {{ level [ {shape} Shape {{ geometry Box {{ }} }} ] }}": 2,
    }
    for text, expected in cases.items():
        assert read_vrml(write(tmp_path, text)).triangle_count == expected


def test_proto_is_drawn_with_its_fields(tmp_path: Path) -> None:
    text = """
    PROTO Part [ exposedField SFColor tint 1 0 0  field MFNode shapes [ ]  field SFVec3f at 0 0 0 ] {
      Transform { translation IS at children IS shapes }
      Shape { geometry Box { } }  # only the first node of the body is drawn
    }
    PROTO Painted [ field SFColor tint 1 0 0 ] {
      Shape { appearance Appearance { material Material { diffuseColor IS tint } } geometry Box { } }
    }
    Part { at 5 0 0 shapes [ Painted { tint 0 0 1 } Painted { } ] }
    """
    mesh = read_vrml(write(tmp_path, text))
    assert mesh.triangle_count == 24
    assert [part.material.diffuse for part in mesh.parts] == [(0, 0, 1), (1, 0, 0)]
    assert bounds(mesh)[0].tolist() == [4, -1, -1]


def test_inline_is_read_beside_the_file(tmp_path: Path) -> None:
    write(tmp_path, f"Shape {{ {SQUARE} }}", "part.wrl")
    mesh = read_vrml(
        write(tmp_path, 'Transform { translation 0 0 3 children Inline { url [ "part.wrl" ] } }')
    )
    assert bounds(mesh)[0].tolist() == [0, 0, 3]
    assert not mesh.self_contained


def test_inline_that_leads_back_to_itself_is_refused(tmp_path: Path) -> None:
    write(tmp_path, 'Inline { url "a.wrl" }', "b.wrl")
    with pytest.raises(MeshError, match="leads back to itself"):
        read_vrml(write(tmp_path, 'Inline { url "b.wrl" }'))


def test_uses_of_uses_cannot_exhaust_the_reader(tmp_path: Path) -> None:
    groups = [f"DEF G{n + 1} Group {{ children [ USE G{n} USE G{n} ] }}" for n in range(60)]
    with pytest.raises(MeshError, match="draws more than 200000 nodes"):
        read_vrml(write(tmp_path, "\n".join(["DEF G0 Shape { }", *groups])))


def test_unknown_nodes_scripts_and_routes_do_no_harm(tmp_path: Path) -> None:
    text = f"""WorldInfo {{ title "a {{ brace" info [ "x" "y" ] }}
    DEF T TimeSensor {{ loop TRUE }}
    DEF X Script {{ eventIn SFTime t field SFInt32 n 3 url "javascript: f() {{}}" }}
    ROUTE T.time TO X.t
    Company {{ secret [ 1 2 3 ] other NULL nested Thing {{ }} }}
    Shape {{ {SQUARE} }} # the end"""
    assert read_vrml(write(tmp_path, text)).triangle_count == 2


def test_bracket_in_a_comment_does_not_end_a_list(tmp_path: Path) -> None:
    text = """Shape { geometry IndexedFaceSet { coord Coordinate { point [ 0 0 0, # first ]
      1 0 0, 1 1 0 # last ] ] } coordIndex [ 0 1 2 ] } }""".replace("last ] ]", "last ]\n ]")
    assert read_vrml(write(tmp_path, text)).triangle_count == 1


def test_lines_points_and_text_are_left_out_with_a_warning(tmp_path: Path) -> None:
    mesh = read_vrml(write(tmp_path, "Shape { geometry IndexedLineSet { } }"))
    assert mesh.triangle_count == 0
    assert mesh.warnings == ("line 2: IndexedLineSet is left out",)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("#VRML V1.0 ascii\nSeparator { }", "line 1: is VRML 1.0; only VRML 2.0 is read"),
        ("#hello", "is not VRML 2.0: it begins '#hello'"),
        ("Shape {", "line 2: a field of Shape or '}' was expected, not the file ends"),
        ("Shape { geometry Box { size 1 2 } }", "line 2: Box: size has 2 numbers; it takes 3"),
        ("Group { children [ Shape { } ", "line 2: a '[' that is never closed"),
        ("USE Nobody", "line 2: USE Nobody: nothing of that name was DEFined before"),
        ("\nDEF A Group { children USE A }", "line 3: USE A: nothing of that name was DEFined before"),
        ('WorldInfo { title "open }', "line 2: a string that does not end"),
        ("Shape }", "line 2: '{' was expected after 'Shape', not '}'"),
        (
            "Shape { geometry IndexedFaceSet { coord Coordinate { point [ 0 0 0 ] } coordIndex [ 0 1 2 ] } }",
            "line 2: IndexedFaceSet: coordIndex holds 1; there are 1: 0 to 0, or -1",
        ),
        (
            "Shape { geometry IndexedFaceSet { coord Coordinate { point [ 0 0 0 1 ] } } }",
            "line 2: Coordinate: point has 4 numbers, which do not make rows of 3",
        ),
        ("Group { children [ 1 2 Shape { } ] }", "line 2: a list of numbers with something else in it"),
        ('Inline { url "none.wrl" }', "line 2: Inline: Inline 'none.wrl': no such file beside this one"),
        ("Group { children " * 200, "nodes nested deeper than 120"),
    ],
)
def test_broken_file_is_told_with_its_line(tmp_path: Path, text: str, expected: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(MeshError) as caught:
        read_vrml(path)
    assert str(caught.value).startswith(str(path))
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_file_cut_anywhere_is_an_error_or_a_smaller_mesh(tmp_path: Path) -> None:
    for end in range(20, len(PAPER_SAMPLE), 7):
        path = write(tmp_path, PAPER_SAMPLE[:end])
        with suppress(MeshError):
            assert read_vrml(path).triangle_count <= 8


def test_ending_that_is_not_read_is_told(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match=r"ending '\.igs' is not read; \.wrl, \.vrml, \.3ds are"):
        read_mesh(tmp_path / "a.igs")
