"""IndexedFaceSet (6.23): corners, colours and normals by vertex and by face, creases, concave faces."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robots.shapes import polygons
from robots.shapes.faces import Faces, Table, surface
from robots.shapes.geometry import Geometry, Part
from robots.shapes.polygons import Effort, ears

Draw = Callable[[str], Geometry]

# A square in z = 0 and, beyond its edge x = 1, a wall that rises in x = 1.
POINTS = "coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0, 1 0 1, 1 1 1 ] }"
TWO_FACES = f"{POINTS} coordIndex [ 0 1 2 3 -1 4 5 2 1 -1 ]"
# Red, green, blue, white, black, yellow.
SIX_COLORS = "color Color { color [ 1 0 0, 0 1 0, 0 0 1, 1 1 1, 0 0 0, 1 1 0 ] }"
SIX_RGB = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [0, 0, 0], [1, 1, 0]]


def face_set(draw: Draw, fields: str) -> Part:
    (part,) = draw(f"Shape {{ geometry IndexedFaceSet {{ {fields} }} }}").parts
    return part


def corners(part: Part) -> list[list[list[float]]]:
    """Return the three points of each triangle, rounded."""
    rounded: list[list[list[float]]] = (np.round(part.vertices[part.triangles], 9) + 0.0).tolist()
    return rounded


def colors_at(part: Part) -> dict[tuple[float, ...], set[tuple[float, ...]]]:
    """Return the colours of the vertices at each point."""
    assert part.colors is not None
    found: dict[tuple[float, ...], set[tuple[float, ...]]] = {}
    for number in np.unique(part.triangles).tolist():
        point = tuple(part.vertices[number].tolist())
        found.setdefault(point, set()).add(tuple(part.colors[number].tolist()))
    return found


def area_vector(part: Part) -> list[float]:
    a, b, c = (part.vertices[part.triangles[:, corner]] for corner in range(3))
    total: list[float] = (np.cross(b - a, c - a).sum(axis=0) / 2).tolist()
    return total


def test_faces_are_fans_from_their_first_corner(draw: Draw) -> None:
    part = face_set(draw, TWO_FACES)
    assert corners(part) == [
        [[0, 0, 0], [1, 0, 0], [1, 1, 0]],
        [[0, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[1, 0, 1], [1, 1, 1], [1, 1, 0]],
        [[1, 0, 1], [1, 1, 0], [1, 0, 0]],
    ]


def test_last_face_needs_no_end_marker(draw: Draw) -> None:
    assert len(face_set(draw, TWO_FACES.replace("2 1 -1", "2 1")).triangles) == 4


def test_faces_of_fewer_than_three_corners_are_omitted(draw: Draw) -> None:
    part = face_set(draw, f"{POINTS} coordIndex [ -1 0 -1 0 1 -1 -1 0 1 2 -1 -1 ]")
    assert corners(part) == [[[0, 0, 0], [1, 0, 0], [1, 1, 0]]]


def test_generated_normals_equal_those_of_their_face(draw: Draw) -> None:
    part = face_set(draw, TWO_FACES)
    np.testing.assert_allclose(part.normals[part.triangles[:2]].reshape(-1, 3), [[0, 0, 1]] * 6)
    # (1,0,1) (1,1,1) (1,1,0): counter-clockwise seen from -x... their cross product points to -x.
    np.testing.assert_allclose(part.normals[part.triangles[2:]].reshape(-1, 3), [[-1, 0, 0]] * 6)


def test_ccw_false_flips_faces_and_their_normals(draw: Draw) -> None:
    part = face_set(draw, f"ccw FALSE {TWO_FACES}")
    assert corners(part)[0] == [[1, 1, 0], [1, 0, 0], [0, 0, 0]]
    np.testing.assert_allclose(part.normals[part.triangles[0]], [[0, 0, -1]] * 3)


def test_solid_false_is_visible_from_both_sides(draw: Draw) -> None:
    assert face_set(draw, f"solid FALSE {TWO_FACES}").two_sided
    assert not face_set(draw, TWO_FACES).two_sided


@pytest.mark.parametrize(("crease", "vertices"), [("1.5", 8), ("1.6", 6), ("3.2", 6)])
def test_faces_at_a_right_angle_are_smooth_with_a_larger_crease_angle(
    draw: Draw, crease: str, vertices: int
) -> None:
    part = face_set(draw, f"creaseAngle {crease} {TWO_FACES}")
    assert len(part.vertices) == vertices
    if vertices == 6:
        shared = part.normals[(part.vertices == [1, 0, 0]).all(axis=1)]
        np.testing.assert_allclose(shared, [np.array([-1, 0, 1]) / np.sqrt(2)])


def test_smooth_normals_are_weighted_by_area(draw: Draw) -> None:
    # The wall is half as high as the square is wide.
    points = POINTS.replace("1 0 1, 1 1 1", "1 0 0.5, 1 1 0.5")
    part = face_set(draw, f"creaseAngle 2 {points} coordIndex [ 0 1 2 3 -1 4 5 2 1 -1 ]")
    shared = part.normals[(part.vertices == [1, 0, 0]).all(axis=1)]
    np.testing.assert_allclose(shared, [np.array([-1, 0, 2]) / np.sqrt(5)])


# Normals


def test_vertices_without_a_normal_index_have_the_normals_of_their_points(draw: Draw) -> None:
    part = face_set(
        draw, f"normal Normal {{ vector [ 1 0 0, 0 2 0, 0 0 1, 1 0 0, 0 1 0, 0 0 1 ] }} {TWO_FACES}"
    )
    assert len(part.vertices) == 6
    at = {tuple(v): n for v, n in zip(part.vertices.tolist(), part.normals.tolist(), strict=True)}
    assert at[0, 0, 0] == [1, 0, 0]
    assert at[1, 0, 0] == [0, 1, 0]  # brought to length one
    assert at[1, 1, 1] == [0, 0, 1]


def test_normal_index_selects_the_normal_of_each_corner(draw: Draw) -> None:
    part = face_set(
        draw,
        "normal Normal { vector [ 0 0 1, -1 0 0 ] } normalIndex [ 0 0 0 0 -1 1 1 1 1 -1 ] " + TWO_FACES,
    )
    assert len(part.vertices) == 8
    np.testing.assert_allclose(part.normals[part.triangles[2]], [[-1, 0, 0]] * 3)


@pytest.mark.parametrize(("index", "first"), [("", [0, 0, 1]), ("normalIndex [ 1 0 ]", [0, 1, 0])])
def test_normals_per_face(draw: Draw, index: str, first: list[int]) -> None:
    part = face_set(
        draw, f"normal Normal {{ vector [ 0 0 1, 0 1 0 ] }} normalPerVertex FALSE {index} {TWO_FACES}"
    )
    np.testing.assert_allclose(part.normals[part.triangles[0]], [first] * 3)
    np.testing.assert_allclose(part.normals[part.triangles[3]], [[0, first[2], first[1]]] * 3)


def test_given_normals_are_kept_for_clockwise_faces(draw: Draw) -> None:
    part = face_set(
        draw,
        f"ccw FALSE normalPerVertex FALSE normal Normal {{ vector [ 0 0 -1, 1 0 0 ] }} {TWO_FACES}",
    )
    np.testing.assert_allclose(part.normals[part.triangles[0]], [[0, 0, -1]] * 3)
    assert area_vector(part) == [1, 0, -1]


def test_too_few_normals_are_ignored_with_a_warning(draw: Draw) -> None:
    geometry = draw(
        f"Shape {{ geometry IndexedFaceSet {{ normal Normal {{ vector [ 1 0 0 ] }} {TWO_FACES} }} }}"
    )
    assert geometry.warnings == (
        "line 2, column 18: IndexedFaceSet: normal number 1; there are 1: normal is ignored",
    )
    np.testing.assert_allclose(geometry.parts[0].normals[0], [0, 0, 1])


# Colours


def test_vertices_without_a_color_index_have_the_colors_of_their_points(draw: Draw) -> None:
    part = face_set(draw, f"{SIX_COLORS} {TWO_FACES}")
    found = colors_at(part)
    assert found[0, 0, 0] == {(1, 0, 0, 1)}
    assert found[1, 1, 1] == {(1, 1, 0, 1)}


def test_color_index_selects_the_color_of_each_corner(draw: Draw) -> None:
    part = face_set(draw, f"{SIX_COLORS} colorIndex [ 5 5 5 5 -1 4 4 4 2 -1 ] {TWO_FACES}")
    found = colors_at(part)
    assert found[0, 0, 0] == {(1, 1, 0, 1)}
    assert found[1, 0, 0] == {(1, 1, 0, 1), (0, 0, 1, 1)}
    assert found[1, 0, 1] == {(0, 0, 0, 1)}


@pytest.mark.parametrize(("index", "chosen"), [("", (0, 1)), ("colorIndex [ 3 1 ]", (3, 1))])
def test_colors_per_face(draw: Draw, index: str, chosen: tuple[int, int]) -> None:
    part = face_set(draw, f"{SIX_COLORS} colorPerVertex FALSE {index} {TWO_FACES}")
    assert part.colors is not None
    for triangle, color in zip(part.triangles, [chosen[0]] * 2 + [chosen[1]] * 2, strict=True):
        assert part.colors[triangle].tolist() == [[*SIX_RGB[color], 1.0]] * 3


def test_omitted_faces_also_count_in_the_colors_of_faces(draw: Draw) -> None:
    # The second face has two corners only; the third keeps the third colour.
    fields = f"{SIX_COLORS} colorPerVertex FALSE {POINTS} coordIndex [ 0 1 2 -1 0 1 -1 1 2 3 -1 ]"
    part = face_set(draw, fields)
    assert part.colors is not None
    assert part.colors[part.triangles[1]].tolist() == [[0, 0, 1, 1]] * 3


def test_colors_have_the_materials_opacity_also_with_smooth_normals(draw: Draw) -> None:
    (part,) = draw(
        f"""Shape {{ appearance Appearance {{ material Material {{ transparency 0.25 }} }}
        geometry IndexedFaceSet {{ {SIX_COLORS} creaseAngle 3.2 {TWO_FACES} }} }}"""
    ).parts
    assert colors_at(part)[0, 1, 0] == {(1, 1, 1, 0.75)}
    assert len(part.vertices) == 6


def test_too_short_color_index_is_ignored_with_a_warning(draw: Draw) -> None:
    geometry = draw(f"Shape {{ geometry IndexedFaceSet {{ {SIX_COLORS} colorIndex [ 0 1 ] {TWO_FACES} }} }}")
    assert geometry.parts[0].colors is None
    assert "colorIndex is shorter than coordIndex" in geometry.warnings[0]


# Elements that are missing


def test_faces_of_missing_points_are_omitted_with_a_warning(draw: Draw) -> None:
    geometry = draw(
        f"Shape {{ geometry IndexedFaceSet {{ {POINTS} coordIndex [ 0 1 9 -1 0 1 2 -1 7 8 9 ] }} }}"
    )
    assert geometry.triangle_count == 1
    location, _, text = geometry.warnings[0].partition(": ")
    assert location == "line 2, column 18"
    assert text == ("IndexedFaceSet: coordIndex contains 9; there are 6 points, 0 to 5: 2 faces are left out")


def test_face_set_without_points_draws_nothing(draw: Draw) -> None:
    assert draw("Shape { geometry IndexedFaceSet { } }").parts == ()


# Concave faces: areas by hand; none may have a triangle that is turned over.

CONCAVE = {
    "L": ([(2, 1), (1, 1), (1, 2), (0, 2), (0, 0), (2, 0)], 3.0),
    "arrow": ([(0, 0), (2, -1), (1, 0), (2, 1)], 1.0),
    "corner with points along its edges": (
        [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 1)],
        3.0,
    ),
    "comb": (
        [(0, 0), (5, 0), (5, 2), (4, 2), (4, 1), (3, 1), (3, 2), (2, 2), (2, 1), (1, 1), (1, 2), (0, 2)],
        8.0,
    ),
    "square with a hole, joined by a bridge": (
        [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)],
        12.0,
    ),
    "a point twice": ([(2, 1), (1, 1), (1, 1), (1, 2), (0, 2), (0, 0), (2, 0)], 3.0),
}  # fmt: skip


@pytest.mark.parametrize(("outline", "area"), CONCAVE.values(), ids=CONCAVE)
@pytest.mark.parametrize("clockwise", [False, True])
def test_concave_face_is_triangulated_within_its_outline(
    outline: list[tuple[float, float]], area: float, clockwise: bool
) -> None:
    flat = np.array(outline[::-1] if clockwise else outline, dtype=float)
    # In a plane that is parallel to no axis.
    x, y = np.array([2, -1, 2]) / 3, np.array([2, 2, -1]) / 3
    points = flat[:, :1] * x + flat[:, 1:] * y + [10, 20, 30]
    triangles = ears(points, Effort())
    assert len(triangles) == len(outline) - 2
    a, b, c = (points[triangles[:, corner]] for corner in range(3))
    sign = -1 if clockwise else 1
    areas = np.cross(b - a, c - a) @ (sign * np.cross(x, y)) / 2
    assert (areas > -1e-9).all()
    assert areas.sum() == pytest.approx(area)


def test_face_without_area_has_triangles() -> None:
    flat = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0], [1.5, 0, 0]])
    assert len(ears(flat, Effort())) == 3
    assert len(ears(np.zeros((6, 3)), Effort())) == 4


def test_face_is_triangulated_as_concave_only_with_convex_false(draw: Draw) -> None:
    points = "coord Coordinate { point [ 2 1 0, 1 1 0, 1 2 0, 0 2 0, 0 0 0, 2 0 0 ] }"
    cut = face_set(draw, f"convex FALSE {points} coordIndex [ 0 1 2 3 4 5 -1 ]")
    assert area_vector(cut) == pytest.approx([0, 0, 3])
    a, b, c = (cut.vertices[cut.triangles[:, corner]] for corner in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    fan = face_set(draw, f"{points} coordIndex [ 0 1 2 3 4 5 -1 ]")
    assert [triangle[0] for triangle in corners(fan)] == [[2, 1, 0]] * 4


def zigzag(angles: np.ndarray, radius: np.ndarray) -> np.ndarray:
    return np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(len(angles))])


def spiral(count: int, turns: int) -> np.ndarray:
    """Return an arm that winds outwards on one side and back on the other."""
    out = np.linspace(0.05, 1.0, count // 2)
    both = np.concatenate([out, out[::-1]])
    width = np.where(np.arange(count) < count // 2, 0.0, 0.4 / turns)
    return zigzag(both * turns * 2 * np.pi, 100 * both * (1 - width))


def comb(teeth: int) -> np.ndarray:
    """Return a bar of height 1 with teeth that are half as wide as their spacing."""
    at = np.repeat(np.arange(teeth)[::-1], 4) + np.tile([0.5, 0.5, 0.0, 0.0], teeth)
    high = np.tile([1.0, 100.0, 100.0, 1.0], teeth)
    top = np.column_stack([at, high])
    return np.column_stack([np.concatenate([[[-1, 0], [teeth, 0]], top]), np.zeros(4 * teeth + 2)])


LARGE = {
    "star": zigzag(np.arange(4000) * (2 * np.pi / 4000), np.where(np.arange(4000) % 2, 1.0, 0.8)),
    "spiral": spiral(10_000, 20),
    "close spiral": spiral(10_000, 200),
    "comb": comb(2000),
}


@pytest.mark.slow
@pytest.mark.parametrize("outline", LARGE.values(), ids=LARGE)
def test_large_concave_face_is_triangulated_with_little_effort(outline: np.ndarray) -> None:
    # The area of a polygon by Gauss's formula.
    x, y = outline[:, 0], outline[:, 1]
    expected = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    effort = Effort()
    effort.read(20 * len(outline))
    effort.grant(len(outline))
    given = effort.left
    triangles = ears(outline, effort)
    a, b, c = (outline[triangles[:, corner]] for corner in range(3))
    areas = np.cross(b - a, c - a)[:, 2] / 2
    assert (areas * np.sign(expected) > -1e-9).all()
    assert areas.sum() == pytest.approx(expected)
    assert effort.left > given / 2


def test_face_beyond_the_effort_limit_is_cut_roughly_with_a_warning(
    draw: Draw, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(polygons, "_A_CORNER", 0)
    monkeypatch.setattr(polygons, "_BEYOND", -1)
    points = "coord Coordinate { point [ 2 1 0, 1 1 0, 1 2 0, 0 2 0, 0 0 0, 2 0 0 ] }"
    geometry = draw(
        f"Shape {{ geometry IndexedFaceSet {{ convex FALSE {points} coordIndex [ 0 1 2 3 4 5 -1 ] }} }}"
    )
    assert geometry.triangle_count == 4
    (warning,) = geometry.warnings
    assert warning.startswith("line 2, column 18: IndexedFaceSet: concave faces take too long")


def test_slow_faces_of_one_file_share_one_effort_limit(draw: Draw, monkeypatch: pytest.MonkeyPatch) -> None:
    outline = comb(500)
    shape = face_set_text(outline)
    monkeypatch.setattr(polygons, "_A_CORNER", 0)
    # The amount that one of them needs.
    effort = Effort()
    ears(outline, effort)
    monkeypatch.setattr(polygons, "_BEYOND", int(1.5 * (polygons._BEYOND - effort.left)))
    geometry = draw(shape * 4)
    assert geometry.triangle_count == 4 * (len(outline) - 2)
    assert len([warning for warning in geometry.warnings if "too long to triangulate" in warning]) == 3


@pytest.mark.slow
def test_corners_of_a_file_are_granted_once_however_often_a_proto_draws_them(
    draw: Draw, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The face of each instance is triangulated anew, because its `convex` could differ."""
    outline = comb(500)
    body = face_set_text(outline).replace("convex FALSE", "convex IS c")
    monkeypatch.setattr(polygons, "_BEYOND", 0)
    geometry = draw(f"PROTO P [ field SFBool c FALSE ] {{ {body} }} " + "P { } " * 100)
    assert geometry.triangle_count == 100 * (len(outline) - 2)
    rough = [warning for warning in geometry.warnings if "too long to triangulate" in warning]
    # The text has a few characters a corner, so it pays for a few instances.
    assert len(rough) > 50


def test_exhausted_effort_ends_the_search_for_ears(monkeypatch: pytest.MonkeyPatch) -> None:
    outline = comb(16_000)
    monkeypatch.setattr(polygons, "_A_CORNER", 0)
    monkeypatch.setattr(polygons, "_BEYOND", -1)
    looks = 0

    def looked(*_: object) -> bool:
        nonlocal looks
        looks += 1
        return True

    monkeypatch.setattr(polygons._Clipping, "is_ear", looked)
    assert len(ears(outline, Effort())) == len(outline) - 2
    assert looks == 0


def face_set_text(outline: np.ndarray) -> str:
    points = ", ".join(" ".join(map(str, point)) for point in outline.tolist())
    numbers = " ".join(map(str, range(len(outline))))
    return (
        f"Shape {{ geometry IndexedFaceSet {{ convex FALSE coord Coordinate {{ point [ {points} ] }} "
        f"coordIndex [ {numbers} -1 ] }} }}\n"
    )


# Any faces


@given(
    st.lists(st.lists(st.integers(0, 11), max_size=7), max_size=8),
    st.booleans(),
    st.booleans(),
    st.booleans(),
    st.sampled_from([0.0, 0.5, 4.0]),
)
def test_any_faces_keep_their_corners_normals_and_colors(
    faces: list[list[int]], ccw: bool, convex: bool, given_normals: bool, crease: float
) -> None:
    points = np.random.default_rng(1).random((12, 3))
    corners = np.array([corner for face in faces for corner in face], dtype=np.int64)
    table = Table(np.eye(3)[np.arange(12) % 3], corners)
    found = surface(
        Faces(
            points,
            corners,
            np.array([len(face) for face in faces], dtype=np.int64),
            normals=table if given_normals else None,
            colors=table,
            ccw=ccw,
            convex=convex,
            crease=crease,
        ),
        Effort(),
    )
    assert len(found.triangles) == sum(max(len(face) - 2, 0) for face in faces)
    assert found.colors is not None
    number = {tuple(point): index for index, point in enumerate(points.tolist())}
    at = np.array([number[tuple(vertex)] for vertex in found.vertices.tolist()], dtype=np.int64)
    np.testing.assert_array_equal(found.colors, np.eye(3)[at % 3])
    if given_normals:
        np.testing.assert_array_equal(found.normals, np.eye(3)[at % 3])
    # The triangles of each face use its corners and no others, all of them.
    start = 0
    for face in faces:
        count = max(len(face) - 2, 0)
        assert set(at[found.triangles[start : start + count]].ravel()) == (set(face) if count else set())
        start += count
