"""The order of dropped files in Define, guessed from which parts touch."""

from pathlib import Path

import pinocchio
import pytest

from robots.shapes.files.read import read_geometry
from robots.shapes.surface_points import surface_points
from tests import page_modules

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def module(tmp_path_factory):
    """Return the path of the page's modules as one file for Node."""
    return page_modules.bundle(
        tmp_path_factory.mktemp("order"),
        order="features/define/opening/part-order.ts",
    )


def test_parts_of_a_real_arm_without_names_are_ordered_by_what_touches(module, shared):
    folder = shared / "testdata" / "urdf"
    urdf = str(folder / "motoman_gp8_support" / "urdf" / "gp8.urdf")
    model = pinocchio.buildModelFromUrdf(urdf)
    shapes = pinocchio.buildGeomFromUrdf(
        model, urdf, pinocchio.GeometryType.VISUAL, package_dirs=[str(folder)]
    )
    data, places = model.createData(), shapes.createData()
    pinocchio.updateGeometryPlacements(model, data, shapes, places, pinocchio.neutral(model))
    parts = []
    for letter, shape, place in zip("fbgdaec", shapes.geometryObjects, places.oMg, strict=True):
        own = surface_points(read_geometry(Path(shape.meshPath)), 200) * shape.meshScale.ravel()
        parts.append(
            {"path": f"part-{letter}.stl", "points": (own @ place.rotation.T + place.translation).tolist()}
        )
    [answer] = page_modules.ask(module, "answer(asked.map(page.guessOrder));", [parts])
    assert answer == {
        "paths": [part["path"] for part in parts],
        "by": "geometry",
        "unnamed": sorted(part["path"] for part in parts),
    }
