"""3DS, chunk by chunk, from bytes written here."""

import struct
from pathlib import Path

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files.three_ds.read import read_3ds
from robots.shapes.geometry import Geometry, bounds

FILES = Path(__file__).with_name("files") / "3ds"

# A tetrahedron, its faces seen from outside.
CORNERS = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
FACES = [(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]


def chunk(identity: int, *contents: bytes) -> bytes:
    content = b"".join(contents)
    return struct.pack("<HI", identity, len(content) + 6) + content


def vertices(points: list[tuple[float, ...]] | None = None) -> bytes:
    points = CORNERS if points is None else points
    return chunk(0x4110, struct.pack("<H", len(points)), *(struct.pack("<3f", *p) for p in points))


def faces(*below: bytes, numbers: list[tuple[int, int, int]] | None = None) -> bytes:
    numbers = FACES if numbers is None else numbers
    return chunk(
        0x4120, struct.pack("<H", len(numbers)), *(struct.pack("<4H", *f, 7) for f in numbers), *below
    )


def painted(name: str, *numbers: int) -> bytes:
    return chunk(0x4130, name.encode() + b"\0", struct.pack(f"<H{len(numbers)}H", len(numbers), *numbers))


def an_object(*contents: bytes, name: str = "tetra") -> bytes:
    return chunk(0x4000, name.encode() + b"\0", chunk(0x4100, *contents))


def a_file(*editor: bytes, keyframes: bytes = b"") -> bytes:
    return chunk(0x4D4D, chunk(0x3D3D, *editor), keyframes)


def read(folder: Path, data: bytes) -> Geometry:
    path = folder / "some.3ds"
    path.write_bytes(data)
    return read_3ds(path)


def track(identity: int, *values: float, spline: tuple[float, ...] = (), flags: int = 0) -> bytes:
    key = struct.pack(f"<IH{len(spline)}f{len(values)}f", 0, flags, *spline, *values)
    return chunk(identity, struct.pack("<H8xI", 0, 1), key)


def key_object(name: str, number: int, parent: int, *tracks: bytes, instance: str = "") -> bytes:
    named = chunk(0xB011, instance.encode() + b"\0") if instance else b""
    header = chunk(0xB010, name.encode() + b"\0", struct.pack("<3H", 0, 0, parent))
    return chunk(0xB002, chunk(0xB030, struct.pack("<H", number)), header, named, *tracks)


def test_faces_of_several_materials_become_parts_and_the_rest_is_grey(tmp_path: Path) -> None:
    material = chunk(0xAFFF, chunk(0xA000, b"red\0"), chunk(0xA020, chunk(0x0011, b"\xff\0\0")))
    geometry = read(
        tmp_path, a_file(material, an_object(vertices(), faces(painted("red", 0, 2), painted("x", 1))))
    )
    found = [(part.material.name, part.material.diffuse, len(part.triangles)) for part in geometry.parts]
    assert found == [("red", (1.0, 0.0, 0.0), 2), ("x", (0.8, 0.8, 0.8), 1), ("", (0.8, 0.8, 0.8), 1)]
    assert geometry.warnings == ("object 'tetra': no material 'x' in the file; drawn grey",)


@pytest.mark.parametrize(
    ("color", "expected"),
    [
        (chunk(0x0010, struct.pack("<3f", 0.25, 0.5, 1.5)), (0.25, 0.5, 1.0)),
        (chunk(0x0011, bytes([51, 102, 255])), (0.2, 0.4, 1.0)),
        (chunk(0x0012, bytes([51, 102, 255])), (0.2, 0.4, 1.0)),
        (chunk(0x0013, struct.pack("<3f", 0.25, 0.5, 1.0)), (0.25, 0.5, 1.0)),
        # Both: the visible one, at any position.
        (chunk(0x0012, bytes([9, 9, 9])) + chunk(0x0011, bytes([51, 102, 255])), (0.2, 0.4, 1.0)),
    ],
)
def test_every_form_of_a_colour_is_read(
    tmp_path: Path, color: bytes, expected: tuple[float, float, float]
) -> None:
    material = chunk(0xAFFF, chunk(0xA000, b"m\0"), chunk(0xA020, color))
    (part,) = read(tmp_path, a_file(material, an_object(vertices(), faces(painted("m", 0, 1, 2, 3))))).parts
    assert part.material.diffuse == pytest.approx(expected)


@pytest.mark.parametrize(
    "fraction", [chunk(0x0030, struct.pack("<h", 40)), chunk(0x0031, struct.pack("<f", 0.4))]
)
def test_fractions_are_read_as_percent_or_float(tmp_path: Path, fraction: bytes) -> None:
    material = chunk(
        0xAFFF,
        chunk(0xA000, b"m\0"),
        chunk(0xA020, chunk(0x0011, b"\xff\xff\0")),
        chunk(0xA030, chunk(0x0011, b"\0\xff\0")),
        chunk(0xA040, fraction),
        chunk(0xA050, fraction),
        chunk(0xA084, fraction),
        chunk(0xA081),
        chunk(0xA200, chunk(0xA300, b"WOOD.TGA\0")),
    )
    geometry = read(tmp_path, a_file(material, an_object(vertices(), faces(painted("m", 0, 1, 2, 3)))))
    (part,) = geometry.parts
    assert part.material.shininess == pytest.approx(0.4)
    assert part.material.transparency == pytest.approx(0.4)
    assert part.material.emissive == pytest.approx((0.4, 0.4, 0.0))
    assert part.material.specular == (0.0, 1.0, 0.0)
    assert part.material.texture == "WOOD.TGA"
    assert part.two_sided
    assert geometry.warnings == ("textures are kept by name, not drawn: WOOD.TGA",)


def test_faces_of_one_smoothing_group_share_their_normals(tmp_path: Path) -> None:
    def normals(*groups: int) -> int:
        smooth = chunk(0x4150, struct.pack("<4I", *groups))
        (part,) = read(tmp_path, a_file(an_object(vertices(), faces(smooth)))).parts
        return len(part.vertices)

    assert normals(1, 1, 1, 1) == 4  # a vertex a corner: smooth all round
    assert normals(0, 0, 0, 0) == 12  # every face its own
    assert normals(1, 2, 4, 1) == 10  # two faces smooth over the edge that they share
    assert normals(0x80000000, 0x80000000, 0x80000000, 0x80000000) == 4


def volume(geometry: Geometry) -> float:
    return sum(float(np.linalg.det(part.vertices[t])) for part in geometry.parts for t in part.triangles) / 6


@pytest.mark.parametrize("turned", [False, True])
def test_faces_of_a_mirrored_object_point_outwards_in_either_order(tmp_path: Path, turned: bool) -> None:
    frame = chunk(0x4160, np.vstack([np.diag([-1.0, 1.0, 1.0]), np.zeros(3)]).astype("<f4").tobytes())
    numbers = [face[::-1] for face in FACES] if turned else FACES
    geometry = read(tmp_path, a_file(an_object(vertices(), frame, faces(numbers=numbers))))
    assert volume(geometry) == pytest.approx(1 / 6)


def test_hierarchy_sets_parents_and_pivots_but_moves_no_vertex(tmp_path: Path) -> None:
    quarter = np.pi / 2
    keyframes = chunk(
        0xB000,
        # The child first: parents may follow. Its number is not its place.
        key_object("tetra", 7, 3, track(0xB020, 5, 0, 0, spline=(0.5, 0.5), flags=3)),
        key_object(
            "$$$DUMMY", 3, 65535, track(0xB020, 1, 2, 3), track(0xB021, -quarter, 0, 0, 1), instance="arm"
        ),
    )
    geometry = read(tmp_path, a_file(an_object(vertices(), faces()), keyframes=keyframes))
    assert [(node.name, node.parent) for node in geometry.nodes] == [("tetra", 1), ("arm", -1)]
    # Clockwise about z by -90 degrees: x becomes y.
    np.testing.assert_allclose(geometry.nodes[1].node_to_file[:3, 0], [0, 1, 0], atol=1e-7)
    np.testing.assert_allclose(geometry.nodes[0].node_to_file[:3, 3], [1, 2 + 5, 3], atol=1e-6)
    assert bounds(geometry)[1].tolist() == [1, 1, 1]


def test_copies_in_the_key_frames_cause_a_warning(tmp_path: Path) -> None:
    keyframes = chunk(0xB000, key_object("tetra", 0, 65535), key_object("tetra", 1, 65535, instance="second"))
    geometry = read(tmp_path, a_file(an_object(vertices(), faces()), keyframes=keyframes))
    assert [node.name for node in geometry.nodes] == ["tetra", "tetra.second"]
    assert geometry.warnings == ("object 'tetra': 1 copies of it in the key frames are not drawn",)
    assert geometry.triangle_count == 4


@pytest.mark.parametrize("number", [b"", b"\7", b"\0\0\7"])
def test_an_objects_number_in_the_key_frames_is_its_first_two_bytes_if_it_has_them(
    tmp_path: Path, number: bytes
) -> None:
    parent = chunk(
        0xB002, chunk(0xB010, b"$$$DUMMY\0", struct.pack("<3H", 0, 0, 65535)), chunk(0xB030, number)
    )
    keyframes = chunk(0xB000, parent, key_object("tetra", 1, 0))
    geometry = read(tmp_path, a_file(an_object(vertices(), faces()), keyframes=keyframes))
    assert [node.parent for node in geometry.nodes] == [-1, 0]


def test_cyclic_hierarchy_is_omitted_with_a_warning(tmp_path: Path) -> None:
    keyframes = chunk(0xB000, key_object("tetra", 0, 1), key_object("b", 1, 0))
    geometry = read(tmp_path, a_file(an_object(vertices(), faces()), keyframes=keyframes))
    assert geometry.nodes == ()
    assert (
        "is nested deeper than 1000, or is its own ancestor; the hierarchy is left out"
        in geometry.warnings[0]
    )
    assert geometry.triangle_count == 4


def test_wrong_lengths_of_outer_chunks_are_ignored_with_a_warning(tmp_path: Path) -> None:
    data = bytearray(a_file(an_object(vertices(), faces())))
    data[2:6] = struct.pack("<I", 0xFFFFFFFF)
    data[8:12] = struct.pack("<I", 0x7FFFFFFF)
    geometry = read(tmp_path, bytes(data))
    assert geometry.triangle_count == 4
    assert geometry.warnings[0].startswith("byte 0: chunk 4D4D has 4294967295 bytes; ")
    assert geometry.warnings[1].startswith("byte 6: chunk 3D3D has 2147483647 bytes; ")


@pytest.mark.parametrize(
    ("contents", "expected"),
    [
        (chunk(0x4110, b"\xff\xff"), "a list of 65535 needs 786420 bytes; 0 follow"),
        (chunk(0x4110, b"\x01"), "a list has no count"),
        (struct.pack("<HI", 0x4110, 0xFFFFFFFF), "chunk 4110 has 4294967295 bytes; 6 are left"),
        (struct.pack("<HI", 0x4110, 0), "chunk 4110 has 0 bytes"),
        (vertices() + faces(numbers=[(0, 1, 4)]), "object 'tetra': vertex 4; there are 4"),
        (vertices([(0, 0, 0), (1, 0, 0), (float("nan"), 0, 0), (1, 1, 1)]) + faces(), "non-finite"),
        (vertices() + faces(painted("m", 9)), "face 9; there are 4"),
        (vertices() + faces(chunk(0x4130, b"endless")), "a name does not end with a zero byte"),
    ],
)
def test_invalid_object_is_rejected_with_the_byte(tmp_path: Path, contents: bytes, expected: str) -> None:
    with pytest.raises(ShapeError) as caught:
        read(tmp_path, a_file(an_object(contents)))
    assert caught.value.place.startswith("byte ")
    assert expected in caught.value.reason


@pytest.mark.parametrize("name", ["cubes_with_alpha.3DS", "test1.3ds"])
def test_key_frames_of_real_files_give_the_local_frames_of_their_shapes(name: str) -> None:
    data = (FILES / name).read_bytes()
    nodes = read_3ds(FILES / name).nodes
    assert nodes
    at = 0
    for node in nodes:
        at = data.index(struct.pack("<HI", 0x4160, 54), at + 1)
        frame = np.frombuffer(data, "<f4", 12, at + 6).reshape(4, 3)
        np.testing.assert_allclose(node.node_to_file[:3].T, frame, atol=1e-4)
