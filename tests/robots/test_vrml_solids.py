"""Box (6.4), Cone (6.11), Cylinder (6.14), Sphere (6.42), ElevationGrid (6.17), Extrusion (6.18)."""

from collections.abc import Callable

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files.vrml.extrusion import section_planes
from robots.shapes.geometry import Geometry, Part, bounds

Draw = Callable[[str], Geometry]


def solid(draw: Draw, geometry: str) -> Part:
    (part,) = draw(f"Shape {{ geometry {geometry} }}").parts
    return part


def volume(part: Part) -> float:
    a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def outwards(part: Part) -> bool:
    """Return whether each vertex's normal and its triangles face the same side."""
    a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
    facing = np.cross(b - a, c - a)
    return bool((np.einsum("ij,ikj->ik", facing, part.normals[part.triangles]) > 0).all())


def extent(draw: Draw, geometry: str) -> list[list[float]]:
    return [corner.round(9).tolist() for corner in bounds(draw(f"Shape {{ geometry {geometry} }}"))]


@pytest.mark.parametrize(
    ("geometry", "expected", "share"),
    [
        ("Box { size 1 2 3 }", 6.0, 0),
        ("Box { }", 8.0, 0),
        # Inscribed bodies of 32 sides: sin(2 pi / 32) / (2 pi / 32) = 0.9936 of the circle.
        ("Cylinder { radius 2 height 3 }", 12 * np.pi, 0.0065),
        ("Cylinder { }", 2 * np.pi, 0.0065),
        ("Cone { bottomRadius 1 height 3 }", np.pi, 0.0065),
        ("Cone { }", 2 * np.pi / 3, 0.0065),
        ("Sphere { radius 2 }", 32 * np.pi / 3, 0.02),
        ("Sphere { }", 4 * np.pi / 3, 0.02),
    ],
)
def test_solid_has_its_volume_and_faces_outwards(
    draw: Draw, geometry: str, expected: float, share: float
) -> None:
    part = solid(draw, geometry)
    assert expected * (1 - share) - 1e-9 <= volume(part) <= expected + 1e-9
    assert outwards(part)
    np.testing.assert_allclose(np.linalg.norm(part.normals, axis=1), 1)


@pytest.mark.parametrize(
    ("geometry", "low", "high"),
    [
        ("Box { size 1 2 3 }", [-0.5, -1, -1.5], [0.5, 1, 1.5]),
        ("Sphere { radius 2 }", [-2, -2, -2], [2, 2, 2]),
        ("Cylinder { radius 1 height 6 }", [-1, -3, -1], [1, 3, 1]),
        ("Cone { bottomRadius 3 height 4 }", [-3, -2, -3], [3, 2, 3]),
    ],
)
def test_solid_extends_along_y(draw: Draw, geometry: str, low: list[float], high: list[float]) -> None:
    assert extent(draw, geometry) == [low, high]


def test_cone_has_its_tip_above_and_normals_square_to_its_side(draw: Draw) -> None:
    part = solid(draw, "Cone { bottomRadius 3 height 4 bottom FALSE }")
    tip = part.vertices[:, 1] == 2
    assert (part.vertices[tip][:, [0, 2]] == 0).all()
    # The side falls 4 over 3: its normal rises 3 over 4 (the facets' own, a little off).
    np.testing.assert_allclose(part.normals[~tip][:, 1], 0.6, atol=0.01)


@pytest.mark.parametrize(
    ("fields", "triangles"),
    [
        ("", 32 + 64 + 32),
        ("top FALSE", 32 + 64),
        ("bottom FALSE", 64 + 32),
        ("side FALSE", 32 + 32),
        ("side FALSE top FALSE", 32),
    ],
)
def test_parts_of_a_cylinder_can_be_omitted(draw: Draw, fields: str, triangles: int) -> None:
    assert len(solid(draw, f"Cylinder {{ {fields} }}").triangles) == triangles


def test_parts_of_a_cone_can_be_omitted(draw: Draw) -> None:
    assert len(solid(draw, "Cone { side FALSE }").triangles) == 32
    assert len(solid(draw, "Cone { bottom FALSE }").triangles) == 32
    assert draw("Shape { geometry Cone { side FALSE bottom FALSE } }").parts == ()


def test_negative_size_is_read_as_positive_with_a_warning(draw: Draw) -> None:
    geometry = draw("Shape { geometry Sphere { radius -2 } }")
    assert bounds(geometry)[1].tolist() == [2, 2, 2]
    assert geometry.warnings == ("line 2, column 18: Sphere: a size is -2; it must be above 0",)


# ElevationGrid

GRID = "xDimension 3 zDimension 2 xSpacing 2 zSpacing 5 height [ 0 1 0, 0 3 0 ]"


def test_elevation_grid_rises_above_the_xz_plane(draw: Draw) -> None:
    part = solid(draw, f"ElevationGrid {{ {GRID} }}")
    assert len(part.triangles) == 4
    points = {tuple(point) for point in part.vertices.tolist()}
    assert points == {(0, 0, 0), (2, 1, 0), (4, 0, 0), (0, 0, 5), (2, 3, 5), (4, 0, 5)}
    assert (part.normals[:, 1] > 0).all()
    assert outwards(part)


def test_elevation_grid_is_flipped_by_ccw_false_and_smoothed_by_crease_angle(draw: Draw) -> None:
    down = solid(draw, f"ElevationGrid {{ ccw FALSE solid FALSE {GRID} }}")
    assert (down.normals[:, 1] < 0).all()
    assert down.two_sided
    assert len(solid(draw, f"ElevationGrid {{ creaseAngle 3 {GRID} }}").vertices) == 6


def test_elevation_grid_has_colors_per_vertex_and_per_square(draw: Draw) -> None:
    six = "color Color { color [ 1 0 0, 0 1 0, 0 0 1, 1 1 1, 0 0 0, 1 1 0 ] }"
    part = solid(draw, f"ElevationGrid {{ {six} {GRID} }}")
    assert part.colors is not None
    assert {tuple(c) for c in part.colors[(part.vertices == [2, 3, 5]).all(axis=1)].tolist()} == {
        (0, 0, 0, 1)
    }
    part = solid(draw, f"ElevationGrid {{ {six} colorPerVertex FALSE {GRID} }}")
    assert part.colors is not None
    assert part.colors[part.triangles[3]].tolist() == [[0, 1, 0, 1]] * 3


def test_elevation_grid_has_normals_per_vertex_and_per_square(draw: Draw) -> None:
    six = "normal Normal { vector [ 1 0 0, 0 1 0, 0 0 1, 1 0 0, 0 1 0, 0 0 1 ] }"
    part = solid(draw, f"ElevationGrid {{ {six} {GRID} }}")
    assert len(part.vertices) == 6
    assert part.normals[(part.vertices == [4, 0, 0]).all(axis=1)].tolist() == [[0, 0, 1]]
    part = solid(draw, f"ElevationGrid {{ {six} normalPerVertex FALSE {GRID} }}")
    assert part.normals[part.triangles[0]].tolist() == [[1, 0, 0]] * 3


def test_elevation_grid_of_one_line_draws_nothing(draw: Draw) -> None:
    assert draw("Shape { geometry ElevationGrid { xDimension 3 zDimension 1 height [ 0 0 0 ] } }").parts == ()
    assert draw("Shape { geometry ElevationGrid { } }").parts == ()


# Extrusion


def test_extrusion_without_fields_is_a_box(draw: Draw) -> None:
    part = solid(draw, "Extrusion { }")
    assert len(part.triangles) == 8 + 4
    assert volume(part) == pytest.approx(4.0)
    assert outwards(part)


@pytest.mark.parametrize(
    ("caps", "triangles"),
    [("beginCap FALSE", 10), ("endCap FALSE", 10), ("beginCap FALSE endCap FALSE", 8)],
)
def test_caps_can_be_omitted(draw: Draw, caps: str, triangles: int) -> None:
    assert len(solid(draw, f"Extrusion {{ {caps} }}").triangles) == triangles


def test_caps_close_an_open_cross_section(draw: Draw) -> None:
    # Three sides of a square: 3 walls, and caps of 4 corners.
    part = solid(draw, "Extrusion { crossSection [ 1 1, 1 -1, -1 -1, -1 1 ] }")
    assert len(part.triangles) == 6 + 4
    assert volume(part) != 0


def test_concave_caps_are_triangulated_within_their_outline(draw: Draw) -> None:
    # An L of area 3, one high.
    section = "crossSection [ 0 0, 0 2, 1 2, 1 1, 2 1, 2 0, 0 0 ] convex FALSE"
    part = solid(draw, f"Extrusion {{ {section} }}")
    assert len(part.triangles) == 6 * 2 + 2 * 4
    assert volume(part) == pytest.approx(3.0)
    flat = np.abs(part.normals[part.triangles][:, :, 1]).min(axis=1) > 0.99
    a, b, c = (part.vertices[part.triangles[flat][:, corner]] for corner in range(3))
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2 == pytest.approx(6.0)


def test_scale_tapers_and_orientation_twists(draw: Draw) -> None:
    part = solid(draw, "Extrusion { scale [ 1 1, 0.5 2 ] orientation [ 0 1 0 0, 0 1 0 1.5707963267948966 ] }")
    top = {tuple(np.round(point, 9).tolist()) for point in part.vertices if point[1] == 1}
    # (x, z) -> (x / 2, 2 z), then a quarter turn about y: (x, z) -> (z, -x).
    assert top == {(2, 1, -0.5), (-2, 1, -0.5), (-2, 1, 0.5), (2, 1, 0.5)}


def test_single_scale_and_orientation_apply_to_all_points(draw: Draw) -> None:
    low, high = extent(draw, "Extrusion { scale 2 3 spine [ 0 0 0, 0 1 0, 0 2 0 ] }")
    assert (low, high) == ([-2, 0, -3], [2, 2, 3])


def test_too_few_values_cause_a_warning(draw: Draw) -> None:
    geometry = draw("Shape { geometry Extrusion { scale [ 1 1, 2 2 ] spine [ 0 0 0, 0 1 0, 0 2 0 ] } }")
    assert "scale has 2 values for 3 spine points; the last is repeated" in geometry.warnings[0]
    with pytest.raises(ShapeError, match="scale is empty"):
        draw("Shape { geometry Extrusion { scale [ ] } }")


def test_extrusion_of_one_point_draws_nothing_with_a_warning(draw: Draw) -> None:
    geometry = draw("Shape { geometry Extrusion { spine [ 0 0 0 ] } }")
    assert geometry.parts == ()
    assert "has 1 spine and 5 crossSection points" in geometry.warnings[0]


def test_ccw_false_turns_an_extrusion_inside_out(draw: Draw) -> None:
    part = solid(draw, "Extrusion { ccw FALSE solid FALSE }")
    assert volume(part) == pytest.approx(-4.0)
    assert part.two_sided


def test_straight_spine_along_x_turns_the_section_about_z(draw: Draw) -> None:
    # The turn that brings y onto x brings x onto -y and keeps z.
    low, high = extent(draw, "Extrusion { spine [ 0 0 0, 5 0 0 ] crossSection [ 3 0, 0 -1, 0 1, 3 0 ] }")
    assert (low, high) == ([0, -3, -1], [5, 0, 1])


def test_square_ring_is_closed_and_even(draw: Draw) -> None:
    # A closed spine: mitred corners, all planes along the diagonals; a tube of 2 x 2 round a 10 x 10 square.
    spine = "spine [ 5 0 5, 5 0 -5, -5 0 -5, -5 0 5, 5 0 5 ]"
    part = solid(draw, f"Extrusion {{ {spine} }}")  # and no caps: there are no ends
    assert len(part.triangles) == 4 * 4 * 2
    planes = section_planes(np.array([[5, 0, 5], [5, 0, -5], [-5, 0, -5], [-5, 0, 5], [5, 0, 5.0]]))
    np.testing.assert_array_equal(planes[0], planes[-1])
    # At the first corner: y from the point before to the one after, (10, 0, -10) / |.|; z up or down.
    np.testing.assert_allclose(planes[0][:, 1], np.array([1, 0, -1]) / np.sqrt(2))
    np.testing.assert_allclose(np.abs(planes[0][:, 2]), [0, 1, 0])


def test_planes_of_a_bent_spine_follow_the_standard() -> None:
    # Up, then along x. At the bend y is the diagonal and z = (1,0,0) x (0,-1,0) = (0,0,-1).
    planes = section_planes(np.array([[0, 0, 0], [0, 1, 0], [1, 1, 0.0]]))
    diagonal = np.array([1, 1, 0]) / np.sqrt(2)
    np.testing.assert_allclose(
        planes[1], np.column_stack([[-diagonal[0], diagonal[1], 0], diagonal, [0, 0, -1]])
    )
    # The ends have the z axis of the bend.
    np.testing.assert_allclose(planes[0], np.column_stack([[-1, 0, 0], [0, 1, 0], [0, 0, -1]]))
    np.testing.assert_allclose(planes[2], np.column_stack([[0, 1, 0], [1, 0, 0], [0, 0, -1]]))


def test_plane_is_flipped_where_the_bend_changes_direction() -> None:
    # An S: the second bend's z would be (0,0,1).
    planes = section_planes(np.array([[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 2, 0.0]]))
    assert planes[:, 2, 2].tolist() == [-1, -1, -1, -1]


def test_straight_segment_keeps_the_previous_plane() -> None:
    planes = section_planes(np.array([[0, 0, 0], [0, 1, 0], [0, 2, 0], [1, 3, 0], [2, 4, 0.0]]))
    # The first bend is at the third point; those before have its z axis, and those after keep it.
    assert planes[:, 2, 2].tolist() == [-1, -1, -1, -1, -1]


def test_coincident_points_have_the_same_plane() -> None:
    spine = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 0], [1, 1, 0.0]])
    planes = section_planes(spine)
    np.testing.assert_array_equal(planes[1], planes[2])
    np.testing.assert_array_equal(planes[[0, 1, 3]], section_planes(spine[[0, 1, 3]]))
    np.testing.assert_array_equal(section_planes(np.ones((3, 3))), [np.eye(3)] * 3)


def test_revolved_section_is_a_ring(draw: Draw) -> None:
    # All spine points coincide: the section turns about y by the orientations alone.
    turns = ", ".join(f"0 1 0 {angle:.15f}" for angle in np.linspace(0, 2 * np.pi, 33))
    part = solid(
        draw,
        f"""Extrusion {{ beginCap FALSE endCap FALSE spine [ {"0 0 0, " * 33} ]
        crossSection [ 2 0, 3 0 ] orientation [ {turns} ] }}""",
    )
    a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    assert area == pytest.approx(32 / 2 * np.sin(2 * np.pi / 32) * 5)
    assert np.abs(part.vertices[:, 1]).max() == 0


def test_seam_of_a_smooth_tube_is_smooth(draw: Draw) -> None:
    circle = " ".join(f"{np.cos(a):.12f} {-np.sin(a):.12f}" for a in np.linspace(0, 2 * np.pi, 9)[:-1])
    first = "1.000000000000 -0.000000000000"
    part = solid(
        draw, f"Extrusion {{ beginCap FALSE endCap FALSE creaseAngle 1 crossSection [ {circle} {first} ] }}"
    )
    assert len(part.vertices) == 16
    np.testing.assert_allclose(part.normals[:, 1], 0, atol=1e-12)
