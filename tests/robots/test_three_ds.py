"""The 3DS reader and writer."""

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files.three_ds.read import read_3ds
from robots.shapes.files.three_ds.write import write_3ds
from robots.shapes.geometry import Geometry, Material, Part, bounds
from robots.shapes.normals import creased
from robots.shapes.solids import box

GLASS = Material("glass", (0.2, 0.4, 0.6), (1.0, 1.0, 1.0), shininess=0.5, transparency=0.25)


def a_box() -> Geometry:
    return Geometry(
        (Part("box", GLASS, *creased(*box(np.zeros(3), np.array([1.0, 2.0, 3.0])), 0.0), two_sided=True),)
    )


def test_written_file_is_read_back_unchanged(tmp_path: Path) -> None:
    path = tmp_path / "box.3ds"
    path.write_bytes(write_3ds(a_box()))
    geometry = read_3ds(path)
    (part,) = geometry.parts
    assert bounds(geometry)[1].tolist() == [1, 2, 3]
    assert part.material == GLASS
    assert part.two_sided
    assert len(part.vertices) == 24  # the edges stay sharp
    facing = np.cross(
        *(part.vertices[part.triangles[:, k]] - part.vertices[part.triangles[:, 0]] for k in (1, 2))
    )
    assert (np.einsum("ij,ij->i", facing, part.normals[part.triangles[:, 0]]) > 0).all()


def test_transparency_and_names_of_a_real_file_are_read() -> None:
    geometry = read_3ds(Path(__file__).with_name("files") / "3ds" / "cubes_with_alpha.3DS")
    transparent = {part.material.name: part.material.transparency for part in geometry.parts}
    assert transparent["Transparent"] == pytest.approx(0.17)
    assert [part.name for part in geometry.parts] == [f"Quader0{number}" for number in range(1, 6)]


def test_truncated_file_is_rejected_or_has_a_warning_with_the_byte(tmp_path: Path) -> None:
    whole = write_3ds(a_box())
    path = tmp_path / "cut.3ds"
    for end in range(len(whole)):
        path.write_bytes(whole[:end])
        try:
            warnings = read_3ds(path).warnings
        except ShapeError as error:
            warnings = (str(error),)
            assert "cut.3ds" in warnings[0]
        assert "byte" in warnings[0] or end < 6, end
        assert "\n" not in warnings[0]


def test_file_with_a_changed_byte_is_read_or_raises_a_shape_error(tmp_path: Path) -> None:
    whole = bytearray(write_3ds(a_box()))
    path = tmp_path / "changed.3ds"
    for position in range(len(whole)):
        changed = bytearray(whole)
        changed[position] ^= 0xFF
        path.write_bytes(changed)
        with suppress(ShapeError):
            read_3ds(path)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "is not a 3DS file: it does not begin with chunk 4D4D"),
        (b"#VRML V2.0 utf8\n", "is not a 3DS file"),
        (
            b"MM\xff\xff\x00\x00",
            "byte 0: chunk 4D4D has 65535 bytes; 6 are left; read to the end",
        ),
    ],
)
def test_invalid_file_is_rejected_with_a_reason(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "wrong.3ds"
    path.write_bytes(content)
    with pytest.raises(ShapeError, match=r"wrong\.3ds") as caught:
        read_3ds(path)
    assert expected in str(caught.value)


def test_missing_file_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="cannot be read: No such file"):
        read_3ds(tmp_path / "none.3ds")
