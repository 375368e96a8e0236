"""STEP and IGES files of a box, read by Open CASCADE in a separate process."""

from itertools import count
from pathlib import Path

import numpy as np
import pytest

from robots.schema.errors import ShapeError
from robots.shapes.files.read import read_geometry
from robots.shapes.files.step import read_step
from robots.shapes.geometry import bounds

MILLIMETRE = "SI_UNIT(.MILLI.,.METRE.)"
METRE = "SI_UNIT($,.METRE.)"


def step_box(
    size: tuple[float, float, float],
    *,
    unit: str = MILLIMETRE,
    color: tuple[float, float, float] | None = None,
) -> str:
    """Return the text of a STEP file of a box from the origin to `size`."""
    lines: list[str] = []
    numbers = count(1)

    def add(text: str) -> str:
        number = next(numbers)
        lines.append(f"#{number}={text};")
        return f"#{number}"

    def chain(*texts: str) -> str:
        """Return the last of nodes that each name the one before."""
        made = ""
        for text in texts:
            made = add(text.format(made))
        return made

    def point(values: list[float]) -> str:
        return add(f"CARTESIAN_POINT('',({_listed(values)}))")

    def direction(axis: int, sign: float = 1.0) -> str:
        return add(f"DIRECTION('',({_listed([sign * (axis == k) for k in range(3)])}))")

    def corner(number: int) -> list[float]:
        return [size[k] if number >> k & 1 else 0.0 for k in range(3)]

    length = add(f"(LENGTH_UNIT()NAMED_UNIT(*){unit})")
    angle = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
    solid = add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
    exact = add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-06),{length},'accuracy','')")
    context = add(
        f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({exact}))"
        f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{solid}))REPRESENTATION_CONTEXT('',''))"
    )
    vertices = [add(f"VERTEX_POINT('',{point(corner(number))})") for number in range(8)]
    edges: dict[tuple[int, int], str] = {}

    def edge(start: int, end: int) -> str:
        low, high = min(start, end), max(start, end)
        if (low, high) not in edges:
            vector = add(f"VECTOR('',{direction((low ^ high).bit_length() - 1)},1.)")
            line = add(f"LINE('',{point(corner(low))},{vector})")
            edges[low, high] = add(f"EDGE_CURVE('',{vertices[low]},{vertices[high]},{line},.T.)")
        return add(f"ORIENTED_EDGE('',*,*,{edges[low, high]},{'.T.' if start < end else '.F.'})")

    faces = []
    for axis in range(3):
        one, other = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
        for side in (0, 1):
            base = side << axis
            loop = [base, base + one, base + one + other, base + other]
            if not side:
                loop = [loop[0], *loop[:0:-1]]
            around = ",".join(edge(a, b) for a, b in zip(loop, loop[1:] + loop[:1], strict=True))
            bound = chain(f"EDGE_LOOP('',({around}))", "FACE_OUTER_BOUND('',{},.T.)")
            normal, first = direction(axis, 1.0 if side else -1.0), direction((axis + 1) % 3)
            axes = add(f"AXIS2_PLACEMENT_3D('',{point(corner(base))},{normal},{first})")
            faces.append(chain(f"PLANE('',{axes})", f"ADVANCED_FACE('',({bound}),{{}},.T.)"))
    brep = chain(f"CLOSED_SHELL('',({','.join(faces)}))", "MANIFOLD_SOLID_BREP('box',{})")
    origin = add(f"AXIS2_PLACEMENT_3D('',{point([0, 0, 0])},{direction(2)},{direction(0)})")
    shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({origin},{brep}),{context})")
    application = add("APPLICATION_CONTEXT('automotive design')")
    definition = add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')")
    product = chain(
        f"PRODUCT_CONTEXT('',{application},'mechanical')",
        "PRODUCT('link','link','',({}))",
        "PRODUCT_DEFINITION_FORMATION('','',{})",
        f"PRODUCT_DEFINITION('design','',{{}},{definition})",
        "PRODUCT_DEFINITION_SHAPE('','',{})",
    )
    add(f"SHAPE_DEFINITION_REPRESENTATION({product},{shape})")
    if color is not None:
        chain(
            f"COLOUR_RGB('',{_listed(list(color))})",
            "FILL_AREA_STYLE_COLOUR('',{})",
            "FILL_AREA_STYLE('',({}))",
            "SURFACE_STYLE_FILL_AREA({})",
            "SURFACE_SIDE_STYLE('',({}))",
            "SURFACE_STYLE_USAGE(.BOTH.,{})",
            "PRESENTATION_STYLE_ASSIGNMENT(({}))",
            f"STYLED_ITEM('color',({{}}),{brep})",
            f"MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',({{}}),{context})",
        )
    return (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\n"
        "FILE_NAME('box','2026-01-01T00:00:00',(''),(''),'','','');\n"
        "FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\nENDSEC;\nDATA;\n"
        + "\n".join(lines)
        + "\nENDSEC;\nEND-ISO-10303-21;\n"
    )


def _listed(values: list[float]) -> str:
    return ",".join(f"{float(value):.6f}" for value in values)


@pytest.mark.parametrize(("unit", "unit_m"), [(MILLIMETRE, 0.001), (METRE, 1.0)])
@pytest.mark.slow
def test_box_keeps_the_files_unit_axes_and_colour(tmp_path: Path, unit: str, unit_m: float) -> None:
    path = tmp_path / "box.step"
    path.write_text(step_box((10, 20, 30), unit=unit, color=(1.0, 0.5, 0.25)))
    geometry = read_geometry(path)
    assert geometry.triangle_count == 12
    np.testing.assert_allclose(bounds(geometry), [[0, 0, 0], [10, 20, 30]], atol=1e-5)
    assert geometry.parts[0].material.diffuse == pytest.approx((1.0, 0.5, 0.25), abs=0.01)
    assert (geometry.unit_m, geometry.up, geometry.warnings) == (unit_m, "z", ())


@pytest.mark.slow
def test_triangles_face_outwards(tmp_path: Path) -> None:
    path = tmp_path / "box.stp"
    path.write_text(step_box((1, 2, 3)))
    volume = sum(np.linalg.det(p.vertices[t]) for p in read_step(path).parts for t in p.triangles) / 6
    assert volume == pytest.approx(6.0, rel=1e-5)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"", "is empty"),
        (b"solid x", "is not a STEP file: one begins with ISO-10303-21"),
        (b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=POINT(", "line 6: Incorrect syntax"),
        (step_box((1, 2, 3))[:3000].encode(), "unexpected end of file"),
    ],
)
@pytest.mark.slow
def test_invalid_file_is_rejected_with_a_reason(tmp_path: Path, content: bytes, expected: str) -> None:
    path = tmp_path / "broken.step"
    path.write_bytes(content)
    with pytest.raises(ShapeError, match=r"broken\.step") as caught:
        read_step(path)
    assert expected in caught.value.reason
    assert "\n" not in str(caught.value)


@pytest.mark.slow
def test_reading_is_stopped_at_the_time_limit(tmp_path: Path) -> None:
    path = tmp_path / "endless.step"
    # Open CASCADE hangs on a length that is no number.
    path.write_text(step_box((10, 20, 30)).replace("10.000000", "nan"))
    with pytest.raises(ShapeError, match="Open CASCADE"):
        read_step(path, time_limit_s=3.0)


@pytest.mark.parametrize("megabytes", [150, 190, 210, 220])
@pytest.mark.slow
def test_lack_of_memory_is_reported_instead_of_a_missing_model(tmp_path: Path, megabytes: int) -> None:
    path = tmp_path / "box.step"
    path.write_text(step_box((1, 2, 3)))
    # With so little memory it fails while it is loaded, or later without a message.
    with pytest.raises(ShapeError, match=r"GB of memory|more than 20 s"):
        read_step(path, time_limit_s=20.0, memory_limit=megabytes << 20)


@pytest.mark.parametrize("name", ["part.igs", "part.IGES", "part.stl"])
@pytest.mark.slow
def test_iges_is_read_in_millimetres_whatever_its_unit_and_ending_are(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    # 10 x 20 x 30 inches, by Open CASCADE 8.0.
    path.write_bytes((Path(__file__).parent / "box_in_inches.igs").read_bytes())
    geometry = read_geometry(path)
    np.testing.assert_allclose(bounds(geometry), [[0, 0, 0], [254, 508, 762]], atol=1e-4)
    volume = sum(np.linalg.det(p.vertices[t]) for p in geometry.parts for t in p.triangles) / 6
    assert volume == pytest.approx(254 * 508 * 762, rel=1e-5)
    assert (geometry.unit_m, geometry.up) == (0.001, "z")
    assert geometry.warnings[-1] == "the colours of IGES are not read: export STEP to keep them"
    assert len(geometry.warnings) == 1 + (name == "part.stl")


@pytest.mark.parametrize("kept", [0, 4, 60])
@pytest.mark.slow
def test_a_cut_iges_file_is_rejected_with_a_reason(tmp_path: Path, kept: int) -> None:
    path = tmp_path / "cut.igs"
    whole = (Path(__file__).parent / "box_in_inches.igs").read_text()
    path.write_text("".join(whole.splitlines(keepends=True)[:kept]))
    with pytest.raises(ShapeError, match=r"is empty|Open CASCADE found no IGES model"):
        read_geometry(path)
