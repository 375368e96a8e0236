"""Appearance (6.3), Material (6.27), ImageTexture (6.22); IndexedLineSet (6.24) and PointSet (6.36)."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from robots.shapes.geometry import Geometry, Material, Wire

Draw = Callable[[str], Geometry]


def material(draw: Draw, appearance: str) -> Material:
    (part,) = draw(f"Shape {{ appearance {appearance} geometry Box {{ }} }}").parts
    return part.material


def test_material_has_all_its_fields(draw: Draw) -> None:
    found = material(
        draw,
        """Appearance { material DEF Steel Material { diffuseColor 0.1 0.2 0.3 specularColor 0.4 0.5 0.6
        emissiveColor 0.7 0.8 0.9 shininess 0.25 transparency 0.5 ambientIntensity 0.9 } }""",
    )
    assert found == Material(
        name="Steel",
        diffuse=(0.1, 0.2, 0.3),
        specular=(0.4, 0.5, 0.6),
        emissive=(0.7, 0.8, 0.9),
        shininess=0.25,
        transparency=0.5,
    )


def test_material_without_fields_has_the_standards_values(draw: Draw) -> None:
    found = material(draw, "Appearance { material Material { } }")
    assert found == Material(
        diffuse=(0.8, 0.8, 0.8), specular=(0, 0, 0), emissive=(0, 0, 0), shininess=0.2, transparency=0
    )


def test_colors_and_fractions_are_clipped_to_zero_to_one(draw: Draw) -> None:
    found = material(
        draw, "Appearance { material Material { diffuseColor 2 -1 0.5 shininess 128 transparency -1 } }"
    )
    assert (found.diffuse, found.shininess, found.transparency) == ((1, 0, 0.5), 1, 0)


@pytest.mark.parametrize("appearance", ["Appearance { }", "Appearance { material NULL }", "NULL"])
def test_shape_without_a_material_is_white(draw: Draw, appearance: str) -> None:
    # 6.3 and 6.41: an unlit object colour of (1, 1, 1).
    assert material(draw, appearance).diffuse == (1, 1, 1)


def test_texture_is_stored_by_name(draw: Draw, tmp_path: Path) -> None:
    (tmp_path / "wood.png").write_bytes(b"")
    text = 'Appearance { material Material { } texture ImageTexture { url [ "none.gif", "wood.png" ] } }'
    geometry = draw(f"Shape {{ appearance {text} geometry Box {{ }} }}")
    assert geometry.parts[0].material.texture == "none.gif"
    assert geometry.warnings == ()


def test_missing_texture_causes_one_warning(draw: Draw) -> None:
    shape = 'Shape { appearance Appearance { texture ImageTexture { url "none.png" } } geometry Box { } }'
    geometry = draw(f"{shape}\n{shape}")
    assert geometry.parts[1].material.texture == "none.png"
    assert geometry.warnings == ("line 2, column 41: ImageTexture: 'none.png': no such file",)


# Lines and points

POINTS = "coord Coordinate { point [ 0 0 0, 1 0 0, 1 1 0, 0 1 0 ] }"
COLORS = "color Color { color [ 1 0 0, 0 1 0, 0 0 1, 1 1 1 ] }"
RED, GREEN, BLUE, WHITE = [1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [1, 1, 1, 1]


def wire(draw: Draw, geometry: str) -> Wire:
    geometry = draw(f"Shape {{ geometry {geometry} }}")
    assert geometry.parts == ()
    (found,) = geometry.wires
    return found


def lines(found: Wire) -> list[list[list[float]]]:
    segments: list[list[list[float]]] = found.vertices[found.segments].tolist()
    return segments


def test_line_set_joins_the_points_of_each_line(draw: Draw) -> None:
    found = wire(draw, f"IndexedLineSet {{ {POINTS} coordIndex [ 0 1 2 -1 3 0 -1 1 -1 ] }}")
    assert lines(found) == [
        [[0, 0, 0], [1, 0, 0]],
        [[1, 0, 0], [1, 1, 0]],
        [[0, 1, 0], [0, 0, 0]],
    ]
    assert found.colors is None


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ("", [[RED, GREEN], [GREEN, BLUE], [WHITE, RED]]),
        ("colorIndex [ 3 3 0 -1 1 2 -1 ]", [[WHITE, WHITE], [WHITE, RED], [GREEN, BLUE]]),
        ("colorPerVertex FALSE", [[RED, RED], [RED, RED], [GREEN, GREEN]]),
        ("colorPerVertex FALSE colorIndex [ 2 0 ]", [[BLUE, BLUE], [BLUE, BLUE], [RED, RED]]),
    ],
)
def test_lines_have_colors_per_vertex_and_per_line(
    draw: Draw, fields: str, expected: list[list[list[float]]]
) -> None:
    found = wire(draw, f"IndexedLineSet {{ {POINTS} {COLORS} {fields} coordIndex [ 0 1 2 -1 3 0 -1 ] }}")
    assert found.colors is not None
    assert found.colors[found.segments].tolist() == expected


def test_lines_to_missing_points_are_omitted_with_a_warning(draw: Draw) -> None:
    geometry = draw(f"Shape {{ geometry IndexedLineSet {{ {POINTS} coordIndex [ 0 1 7 2 3 ] }} }}")
    assert lines(geometry.wires[0]) == [[[0, 0, 0], [1, 0, 0]], [[1, 1, 0], [0, 1, 0]]]
    assert "coordIndex contains 7; there are 4 points, 0 to 3" in geometry.warnings[0]


def test_points_are_moved_by_the_transform(draw: Draw) -> None:
    geometry = draw(
        f"Transform {{ translation 0 0 5 children Shape {{ geometry PointSet {{ {POINTS} {COLORS} }} }} }}"
    )
    (found,) = geometry.wires
    assert found.vertices[2].tolist() == [1, 1, 5]
    assert len(found.segments) == 0
    assert found.colors is not None
    assert found.colors.tolist() == [RED, GREEN, BLUE, WHITE]


def test_points_with_too_few_colors_have_none(draw: Draw) -> None:
    geometry = draw(f"Shape {{ geometry PointSet {{ {POINTS} color Color {{ color [ 1 0 0 ] }} }} }}")
    assert geometry.wires[0].colors is None
    assert "1 colors for 4 points" in geometry.warnings[0]


def test_lines_and_points_count_as_no_triangles(draw: Draw) -> None:
    geometry = draw(f"Shape {{ geometry PointSet {{ {POINTS} }} }} Shape {{ geometry IndexedLineSet {{ }} }}")
    assert geometry.triangle_count == 0
    assert len(geometry.wires) == 1
    np.testing.assert_array_equal(geometry.wires[0].vertices[1], [1, 0, 0])
