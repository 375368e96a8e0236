"""Nodes that hold shapes: grouping nodes, DEF and USE, PROTO and EXTERNPROTO (4.8), Inline (6.25)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files.vrml import protos
from robots.shapes.files.vrml.parser import parse_vrml
from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.files.vrml.source import load
from robots.shapes.files.vrml.values import nodes_of, strings
from robots.shapes.geometry import Geometry, bounds

Draw = Callable[[str], Geometry]

# One triangle with corners at the origin, x = 1 and y = 1.
SHAPE = """Shape { geometry IndexedFaceSet {
  coord Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } coordIndex [ 0 1 2 ] } }"""
BOX = "Shape { geometry Box { size 2 2 2 } }"


def corners(geometry: Geometry) -> list[list[list[float]]]:
    """Return the three corners of each triangle, rounded."""
    return [
        triangle
        for part in geometry.parts
        for triangle in (np.round(part.vertices[part.triangles], 9) + 0.0).tolist()
    ]


def extent(geometry: Geometry) -> list[list[float]]:
    return [np.round(corner, 9).tolist() for corner in bounds(geometry)]


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#VRML V2.0 utf8\n{text}")
    return path


# Transform


@pytest.mark.parametrize(
    ("fields", "low", "high"),
    [
        ("translation 10 20 30", [9, 19, 29], [11, 21, 31]),
        ("scale 1 2 3", [-1, -2, -3], [1, 2, 3]),
        ("rotation 0 0 1 1.5707963267948966 scale 2 1 1", [-1, -2, -1], [1, 2, 1]),
        # An axis need not have length one, and one of length zero turns nothing.
        ("rotation 0 0 7 1.5707963267948966 scale 2 1 1", [-1, -2, -1], [1, 2, 1]),
        ("rotation 0 0 0 1 scale 2 1 1", [-2, -1, -1], [2, 1, 1]),
        # About (1, 1, 1): that corner stays, the others go to -1 - 2.
        ("center 1 1 1 scale 2 2 2", [-3, -3, -3], [1, 1, 1]),
        ("center 1 0 0 rotation 0 0 1 3.141592653589793", [1, -1, -1], [3, 1, 1]),
        ("translation 10 0 0 rotation 0 0 1 1.5707963267948966 scale 2 1 1", [9, -2, -1], [11, 2, 1]),
        ("scale -1 1 1", [-1, -1, -1], [1, 1, 1]),
    ],
)
def test_transform_moves_its_children(draw: Draw, fields: str, low: list[float], high: list[float]) -> None:
    assert extent(draw(f"Transform {{ {fields} children {BOX} }}")) == [low, high]


def test_center_and_scale_orientation_follow_the_standard(draw: Draw) -> None:
    # Stretched along the diagonal about (1, 1, 0): (0, 0) goes to (-1, -1), and (1, 0) across it stays.
    geometry = draw(
        f"""Transform {{ center 1 1 0 scaleOrientation 0 0 1 0.7853981633974483 scale 2 1 1
        children {SHAPE} }}"""
    )
    assert corners(geometry) == [[[-1, -1, 0], [0.5, -0.5, 0], [-0.5, 0.5, 0]]]


def test_transforms_apply_from_the_inside_outwards(draw: Draw) -> None:
    geometry = draw(
        f"Transform {{ scale 2 2 2 children Transform {{ translation 1 0 0 children {SHAPE} }} }}"
    )
    assert corners(geometry) == [[[2, 0, 0], [4, 0, 0], [2, 2, 0]]]


def test_mirroring_scale_keeps_faces_and_normals_outwards(draw: Draw) -> None:
    (part,) = draw(f"Transform {{ scale -1 1 1 children {BOX} }}").parts
    a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    assert (np.einsum("ij,ij->i", facing, a) > 0).all()
    assert (np.einsum("ij,ikj->ik", facing, part.normals[part.triangles]) > 0).all()


def test_uneven_scale_keeps_normals_square_to_their_face(draw: Draw) -> None:
    (part,) = draw(
        f"Transform {{ scale 3 1 1 children Transform {{ rotation 0 0 1 0.6 children {BOX} }} }}"
    ).parts
    a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    facing /= np.linalg.norm(facing, axis=1, keepdims=True)
    np.testing.assert_allclose(part.normals[part.triangles[:, 0]], facing, atol=1e-12)


# Groups


@pytest.mark.parametrize(
    "text",
    [
        "Group { children %s }",
        'Anchor { url "x.html" children [ %s ] }',
        "Billboard { axisOfRotation 0 1 0 children [ %s ] }",
        "Collision { collide FALSE children [ %s ] proxy Shape { geometry Box { } } }",
        "LOD { range [ 10 ] level [ %s Shape { geometry Box { } } ] }",
        "Switch { whichChoice 0 choice [ %s Shape { geometry Box { } } ] }",
        "Switch { whichChoice 1 choice [ Shape { geometry Box { } } %s ] }",
        "Group { children [ NULL %s NULL ] }",
    ],
)
def test_grouping_nodes_draw_their_visible_children(draw: Draw, text: str) -> None:
    assert corners(draw(text % SHAPE)) == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]]]


@pytest.mark.parametrize("which", ["", "whichChoice -1", "whichChoice 2", "whichChoice 1e9"])
def test_switch_without_a_valid_choice_draws_nothing(draw: Draw, which: str) -> None:
    assert draw(f"Switch {{ {which} choice [ {BOX} {BOX} ] }}").parts == ()


def test_levels_of_a_switch_are_read_as_choices(draw: Draw) -> None:
    geometry = draw(f"Switch {{ whichChoice 1 level [ {BOX} {SHAPE} ] }}")
    assert geometry.triangle_count == 1
    assert geometry.warnings == ("line 2, column 1: Switch: has 'level', a field of LOD; read as 'choice'",)


# DEF and USE


def test_used_node_is_drawn_wherever_it_is_used(draw: Draw) -> None:
    geometry = draw(f"DEF S {SHAPE} Transform {{ translation 5 0 0 children [ USE S, USE S ] }}")
    assert geometry.triangle_count == 3
    assert extent(geometry) == [[0, 0, 0], [6, 1, 0]]


def test_coordinates_and_appearance_can_be_used_again(draw: Draw) -> None:
    geometry = draw(
        """Shape { appearance DEF A Appearance { material Material { diffuseColor 1 0 0 } }
          geometry IndexedFaceSet {
            coord DEF C Coordinate { point [ 0 0 0, 1 0 0, 0 1 0 ] } coordIndex [ 0 1 2 ] } }
        Shape { appearance USE A geometry IndexedFaceSet { coord USE C coordIndex [ 2 1 0 ] } }"""
    )
    assert corners(geometry) == [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 0], [1, 0, 0], [0, 0, 0]]]
    assert geometry.parts[1].material.diffuse == (1, 0, 0)


def test_last_def_of_a_name_has_priority(draw: Draw) -> None:
    geometry = draw(f"DEF S {BOX} DEF S {SHAPE} USE S")
    assert geometry.triangle_count == 12 + 1 + 1


@pytest.mark.parametrize("text", ["USE Nobody", "Group { children [ USE Nobody ] }"])
def test_use_of_an_unknown_name_is_omitted_with_a_warning(draw: Draw, text: str) -> None:
    geometry = draw(f"{text} {SHAPE}")
    assert geometry.triangle_count == 1
    column = text.index("USE") + 1
    assert geometry.warnings == (
        f"line 2, column {column}: USE Nobody: no node was DEFined with that name before; left out",
    )


def test_use_of_a_node_in_itself_is_omitted_with_a_warning(draw: Draw) -> None:
    geometry = draw(f"DEF A Group {{ children [ {SHAPE} USE A ] }}")
    assert geometry.triangle_count == 1
    assert "USE A" in geometry.warnings[0]


# PROTO

PROTOS = """
PROTO Part [ exposedField SFVec3f at 0 0 0  field MFNode shapes [ ]  eventIn SFTime now ] {
  Transform { translation IS at children IS shapes set_scale IS now }
  Shape { geometry Box { } }  # only the first node of the body is drawn
}
PROTO Painted [ field SFColor tint 1 0 0 ] {
  Shape { appearance Appearance { material Material { diffuseColor IS tint } } geometry Box { } }
}
"""


def test_proto_is_drawn_with_its_fields(draw: Draw) -> None:
    geometry = draw(PROTOS + "Part { at 5 0 0 shapes [ Painted { tint 0 0 1 } Painted { } ] }")
    assert [part.material.diffuse for part in geometry.parts] == [(0, 0, 1), (1, 0, 0)]
    assert extent(geometry) == [[4, -1, -1], [6, 1, 1]]


def test_unused_proto_draws_nothing(draw: Draw) -> None:
    assert draw(PROTOS).parts == ()


def test_proto_inside_itself_as_a_field_is_no_cycle(draw: Draw) -> None:
    geometry = draw(PROTOS + f"Part {{ at 1 0 0 shapes Part {{ at 0 2 0 shapes {SHAPE} }} }}")
    assert extent(geometry) == [[1, 2, 0], [2, 3, 0]]


def test_is_is_resolved_where_the_proto_is_used(draw: Draw) -> None:
    # Inner's `at` is Outer's `where`; both call the other's field by its own name.
    geometry = draw(
        f"""PROTO Inner [ field SFVec3f at 9 9 9 ] {{ Transform {{ translation IS at children {SHAPE} }} }}
        PROTO Outer [ field SFVec3f where 0 0 0 field SFVec3f at 7 7 7 ] {{ Inner {{ at IS where }} }}
        Outer {{ where 1 2 3 }} Inner {{ }}"""
    )
    assert corners(geometry)[0][0] == [1, 2, 3]
    assert corners(geometry)[1][0] == [9, 9, 9]


def test_proto_can_contain_protos(draw: Draw) -> None:
    geometry = draw(
        f"""PROTO Outer [ ] {{
          PROTO Inner [ field SFVec3f at 1 0 0 ] {{ Transform {{ translation IS at children {SHAPE} }} }}
          Group {{ children [ Inner {{ }} Inner {{ at 2 0 0 }} ] }}
        }}
        Outer {{ }} Inner {{ }}"""
    )
    assert [triangle[0] for triangle in corners(geometry)] == [[1, 0, 0], [2, 0, 0]]
    assert geometry.warnings == ("line 7, column 19: Inner: is not a node of VRML 2.0; skipped",)


def test_names_in_a_proto_are_local(draw: Draw) -> None:
    geometry = draw(
        f"DEF S {BOX} PROTO P [ ] {{ Group {{ children [ DEF S {SHAPE} USE S ] }} }} P {{ }} USE S"
    )
    assert geometry.triangle_count == 12 + 2 + 12


@pytest.mark.parametrize(
    "text",
    [
        "PROTO N [ field SFFloat r 2 ] { Sphere { radius IS r } } Shape { geometry N { } }",
        """PROTO N [ field SFColor c 0 1 0 ] { Material { diffuseColor IS c } }
        Shape { appearance Appearance { material N { } } geometry Sphere { radius 2 } }""",
        """PROTO N [ field SFNode m NULL ] { Appearance { material IS m } }
        Shape { appearance N { m Material { } } geometry Sphere { radius 2 } }""",
        """PROTO N [ field SFNode a NULL field SFNode g NULL ] { Shape { appearance IS a geometry IS g } }
        N { g Sphere { radius 2 } }""",
    ],
)
def test_proto_can_replace_any_node(draw: Draw, text: str) -> None:
    geometry = draw(text)
    assert extent(geometry) == [[-2, -2, -2], [2, 2, 2]]
    if "c 0 1 0" in text:
        assert geometry.parts[0].material.diffuse == (0, 1, 0)


def test_proto_can_replace_coordinates(draw: Draw) -> None:
    geometry = draw(
        """PROTO C [ field MFVec3f p [ 0 0 0, 1 0 0, 0 1 0 ] ] { Coordinate { point IS p } }
        Shape { geometry IndexedFaceSet { coord C { } coordIndex [ 0 1 2 ] } }
        Shape { geometry IndexedFaceSet { coord C { p [ 0 0 9, 1 0 9, 0 1 9 ] } coordIndex [ 0 1 2 ] } }"""
    )
    assert extent(geometry) == [[0, 0, 0], [1, 1, 9]]


def test_empty_proto_draws_nothing(draw: Draw) -> None:
    assert draw("PROTO P [ ] { } P { } Shape { geometry P { } }").parts == ()


def test_proto_without_a_field_of_its_own_has_the_nodes(draw: Draw) -> None:
    # An event has no value: as if it were not written.
    geometry = draw("PROTO P [ eventIn SFFloat r ] { Sphere { radius IS r } } Shape { geometry P { } }")
    assert extent(geometry) == [[-1, -1, -1], [1, 1, 1]]


@pytest.mark.slow
@pytest.mark.parametrize(
    "proto",
    [
        # Wide: none of the 2,000 is drawn, and each use creates them again.
        f"PROTO P [ field MFNode c [ ] ] {{ Switch {{ choice [ {'Group { } ' * 2000} ] children IS c }} }}",
        # A node that is written one time and used 2,000 times.
        f"PROTO P [ field MFNode c [ ] ] {{ Switch {{ level [ DEF G Group {{}} {'USE G ' * 2000}] c IS c}}}}",
        f"PROTO P [ {' '.join(f'field SFFloat f{i} 1' for i in range(3000))} ] {{ Group {{ }} }}",
    ],
    ids=["nodes", "uses", "fields"],
)
def test_proto_uses_with_too_many_nodes_are_rejected(
    tmp_path: Path, proto: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(protos, "MAX_MADE", 500_000)
    # In another file: all files of a scene count together.
    write(tmp_path, "part.wrl", f"{proto} {'P { } ' * 150}")
    path = write(tmp_path, "a.wrl", f'{proto} {"P {} " * 150} Inline {{ url "part.wrl" }}')
    with pytest.raises(ShapeError, match=r"part\.wrl.*PROTOs make more than 500000 nodes and fields"):
        read_vrml(path)


# EXTERNPROTO

LIBRARY = f"""PROTO First [ ] {{ Shape {{ geometry Box {{ }} }} }}
PROTO At [ field SFVec3f at 3 0 0 field MFNode more [ ] ] {{
  Transform {{ translation IS at children [ {SHAPE} Group {{ children IS more }} ] }} }}"""


def test_externproto_is_read_from_its_file(tmp_path: Path) -> None:
    write(tmp_path, "parts/library.wrl", LIBRARY)
    declared = "[ field SFVec3f at exposedField MFNode more eventOut SFTime t ]"
    path = write(
        tmp_path,
        "a.wrl",
        f"""EXTERNPROTO Mine {declared} [ "http://x.org/l.wrl#At" "parts/library.wrl#At" ]
        Mine {{ }} Mine {{ at 5 0 0 }}""",
    )
    geometry = read_vrml(path)
    assert [triangle[0] for triangle in corners(geometry)] == [[3, 0, 0], [5, 0, 0]]
    assert geometry.files == (tmp_path / "parts" / "library.wrl",)
    assert geometry.warnings == ()


def test_externproto_without_a_name_is_the_files_first(tmp_path: Path) -> None:
    write(tmp_path, "library.wrl", LIBRARY)
    path = write(tmp_path, "a.wrl", 'EXTERNPROTO Mine [ ] "library.wrl" Mine { }')
    assert read_vrml(path).triangle_count == 12


def test_externproto_of_an_externproto_is_followed(tmp_path: Path) -> None:
    write(tmp_path, "library.wrl", LIBRARY)
    write(tmp_path, "again.wrl", 'EXTERNPROTO At [ ] "library.wrl#At"')
    path = write(tmp_path, "a.wrl", 'EXTERNPROTO At [ ] "again.wrl#At" At { at 1 1 1 }')
    assert corners(read_vrml(path))[0][0] == [1, 1, 1]


def test_inline_in_an_externproto_is_beside_its_own_file(tmp_path: Path) -> None:
    write(tmp_path, "parts/shape.wrl", SHAPE)
    write(tmp_path, "parts/library.wrl", 'PROTO P [ ] { Inline { url "shape.wrl" } }')
    path = write(tmp_path, "a.wrl", 'EXTERNPROTO P [ ] "parts/library.wrl#P" P { }')
    assert read_vrml(path).triangle_count == 1


@pytest.mark.parametrize(
    ("url", "trouble"),
    [
        ('"none.wrl#P"', "'none.wrl': no such file"),
        ('"library.wrl#None"', "'library.wrl' contains no PROTO None"),
        ('[ "none.wrl#P" "http://x.org/a.wrl#P" ]', "'http://x.org/a.wrl': no such file"),
        ("[ ]", "has no address"),
    ],
)
def test_missing_externproto_is_omitted_with_a_warning(tmp_path: Path, url: str, trouble: str) -> None:
    write(tmp_path, "library.wrl", LIBRARY)
    path = write(tmp_path, "a.wrl", f"EXTERNPROTO P [ ] {url} P {{ }} {SHAPE} P {{ }}")
    geometry = read_vrml(path)
    assert geometry.triangle_count == 1
    assert f"P: EXTERNPROTO P: {trouble}" in geometry.warnings[0]
    assert sum("EXTERNPROTO" in warning for warning in geometry.warnings) == 1


def test_cyclic_externprotos_are_rejected(tmp_path: Path) -> None:
    write(tmp_path, "b.wrl", 'EXTERNPROTO P [ ] "a.wrl#P" PROTO Q [ ] { Group { children [ P { } P { } ] } }')
    path = write(
        tmp_path, "a.wrl", 'EXTERNPROTO Q [ ] "b.wrl#Q" PROTO P [ ] { Group { children Q { } } } P { }'
    )
    with pytest.raises(ShapeError, match=r"EXTERNPROTO . contains itself"):
        read_vrml(path)
    itself = write(tmp_path, "c.wrl", 'EXTERNPROTO P [ ] "c.wrl#P" P { }')
    with pytest.raises(ShapeError, match="EXTERNPROTO P contains itself"):
        read_vrml(itself)


# Inline


def test_inline_is_read_beside_the_file_that_names_it(tmp_path: Path) -> None:
    write(tmp_path, "sub/deeper/shape.wrl", SHAPE)
    write(
        tmp_path, "sub/part.wrl", 'Transform { translation 0 1 0 children Inline { url "deeper/shape.wrl" } }'
    )
    path = write(
        tmp_path, "a.wrl", 'Transform { translation 0 0 3 children Inline { url [ "sub/part.wrl" ] } }'
    )
    geometry = read_vrml(path)
    assert corners(geometry)[0][0] == [0, 1, 3]
    assert geometry.files == (tmp_path / "sub" / "part.wrl", tmp_path / "sub" / "deeper" / "shape.wrl")


@pytest.mark.parametrize(
    "url",
    [
        r"sub\\my part.wrl",
        "sub/my%20part.wrl",
        "sub/my part.wrl",
        "file:sub/my part.wrl",
        "sub/../sub/my part.wrl",
    ],
)
def test_inline_is_found_as_exporters_write_it(tmp_path: Path, url: str) -> None:
    write(tmp_path, "sub/my part.wrl", SHAPE)
    assert read_vrml(write(tmp_path, "a.wrl", f'Inline {{ url "{url}" }}')).triangle_count == 1


def test_inline_reads_the_first_existing_url(tmp_path: Path) -> None:
    write(tmp_path, "b.wrl", SHAPE)
    write(tmp_path, "c.wrl", BOX)
    path = write(tmp_path, "a.wrl", 'Inline { url [ "http://x.org/b.wrl", "none.wrl", "b.wrl", "c.wrl" ] }')
    assert read_vrml(path).triangle_count == 1


def test_missing_inline_is_omitted_with_a_warning(tmp_path: Path) -> None:
    path = write(tmp_path, "a.wrl", f'{SHAPE} Inline {{ url "none.wrl" }}\nInline {{ url "none.wrl" }}')
    geometry = read_vrml(path)
    assert geometry.triangle_count == 1
    assert geometry.warnings == ("line 3, column 79: Inline: 'none.wrl': no such file; it is left out",)


def test_file_with_only_missing_inlines_is_empty_and_lists_them(tmp_path: Path) -> None:
    path = write(tmp_path, "a.wrl", 'Group { children [ Inline { url "x.wrl" } Inline { url "y.wrl" } ] }')
    geometry = read_vrml(path)
    assert geometry.triangle_count == 0
    assert geometry.missing == ("x.wrl", "y.wrl")
    assert geometry.warnings[0] == "line 2, column 20: Inline: 'x.wrl': no such file; it is left out"


def test_cyclic_inlines_are_rejected(tmp_path: Path) -> None:
    write(tmp_path, "b.wrl", 'Inline { url "a.wrl" }')
    with pytest.raises(ShapeError, match=r"b\.wrl, line 2, column 1: Inline: 'a.wrl' includes itself"):
        read_vrml(write(tmp_path, "a.wrl", 'Inline { url "b.wrl" }'))
    with pytest.raises(ShapeError, match="includes itself"):
        read_vrml(write(tmp_path, "c.wrl", 'Inline { url "./c.wrl" }'))


def test_repeated_inline_has_its_warnings_once(tmp_path: Path) -> None:
    write(tmp_path, "b.wrl", f"{SHAPE} Company {{ }}")
    path = write(tmp_path, "a.wrl", 'Inline { url "b.wrl" } Inline { url "b.wrl" } Company { }')
    geometry = read_vrml(path)
    assert geometry.triangle_count == 2
    assert geometry.warnings == ("b.wrl, line 3, column 79: Company: is not a node of VRML 2.0; skipped",)


def test_error_in_an_inline_names_its_file(tmp_path: Path) -> None:
    write(tmp_path, "b.wrl", "Shape {")
    with pytest.raises(ShapeError, match=r"b\.wrl, line 2, column 8: a field of Shape"):
        read_vrml(write(tmp_path, "a.wrl", f'{SHAPE} Inline {{ url "b.wrl" }}'))


def test_files_outside_the_folder_allowed_count_as_missing(tmp_path: Path) -> None:
    write(tmp_path, "secret.wrl", BOX)
    write(tmp_path, "open/part.wrl", SHAPE)
    path = write(
        tmp_path,
        "open/a.wrl",
        f"""Inline {{ url [ "../secret.wrl" ] }} Inline {{ url "{tmp_path}/secret.wrl" }}
        Inline {{ url "part.wrl" }}""",
    )
    assert read_vrml(path, within=tmp_path / "open").triangle_count == 1
    assert read_vrml(path).triangle_count == 25


# Other nodes


def test_nodes_that_draw_nothing_are_named_once(draw: Draw) -> None:
    geometry = draw(
        f"""WorldInfo {{ title "a {{ brace" info [ "x" "y" ] }}
        DEF T TimeSensor {{ loop TRUE }}
        DEF X Script {{ eventIn SFTime t field SFInt32 n 3 field SFNode self USE T
          eventOut SFBool b url "javascript: f() {{}}" directOutput TRUE }}
        ROUTE T.time TO X.set_t
        PointLight {{ }} TimeSensor {{ }} Viewpoint {{ position 1 2 3 }}
        {SHAPE} # the end"""
    )
    assert geometry.triangle_count == 1
    assert geometry.warnings == (
        "line 2, column 1: not drawn: WorldInfo, TimeSensor, Script, PointLight, Viewpoint",
    )


def test_unknown_nodes_are_named_once_each(draw: Draw) -> None:
    geometry = draw(
        f"""Company {{ secret [ 1 2 3 ] other NULL nested Thing {{ }} flags [ TRUE FALSE ] }} Company {{ }}
        Other {{ name "x" }} {SHAPE}
        Shape {{ geometry NurbsSurface {{ }} }} Shape {{ geometry Text {{ string "hi" }} }}"""
    )
    assert geometry.triangle_count == 1
    said = [warning.split(": ", 1)[1] for warning in geometry.warnings]
    assert sorted(said) == [
        "Company: is not a node of VRML 2.0; skipped",
        "NurbsSurface: is not a geometry node of VRML 2.0; left out",
        "Other: is not a node of VRML 2.0; skipped",
        "Text: is not drawn: 'hi'",
    ]


def test_each_text_that_is_left_out_is_quoted_once_in_one_warning(draw: Draw) -> None:
    """A Text without a string draws nothing, so it is not missing."""
    texts = "".join(
        f"Shape {{ geometry Text {{ {field} }} }} "
        for field in ('string [ "axis", "J1" ]', 'string "J2"', 'string "J2"', 'string ""', "")
    )
    (warning,) = draw(f"{SHAPE} {texts}").warnings
    assert warning.endswith(": Text: is not drawn: 'axis J1', 'J2'")
    many = "".join(f'Shape {{ geometry Text {{ string "{number}" }} }} ' for number in range(500))
    (warning,) = draw(f"{SHAPE} {many}").warnings
    assert len(warning) < 300


def test_list_of_nodes_is_not_copied_at_each_use(tmp_path: Path) -> None:
    """Use a list of thousands thousands of times, of which each draws one; this took minutes."""
    path = write(tmp_path, "a.wrl", f"LOD {{ level [ {SHAPE} Group {{ }} ] }}")
    (node,) = parse_vrml(load(path)).nodes
    assert nodes_of(node, "level") is node.fields["level"]
    assert strings(node, "level") == []
