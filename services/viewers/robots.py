"""Conversion of robot descriptions for other programs' viewers (Foxglove, RViz)."""

from collections.abc import Callable

from renderer.scene.appearance import floor_of
from robomesh.schemas.robomesh_pb2 import Description
from robots.descriptions.urdf.viewers import Fixture, Viewed

# Of a fixture without a colour, as on the page.
_FIXTURE_COLOR = "#6f7c88"


def shapes_of(description: Description) -> dict[str, str]:
    """Return the hash (SHA-256, hex) of each mesh of a description, by the mesh's name."""
    hashes = {link.mesh: link.mesh_sha256 for link in description.links}
    hashes |= {fixture.mesh: fixture.mesh_sha256 for fixture in description.fixtures}
    hashes.pop("", None)
    return hashes


def viewer_robot(site: str, robot: str, description: Description, uri: Callable[[str], str | None]) -> Viewed:
    """Return a robot with its cell's fixtures, for a viewer.

    Args:
        uri: Returns the URI of a mesh by its name, or None if the viewer cannot get it.
    """
    shape_of = {link.name: link.mesh for link in description.links}
    fixtures = (
        Fixture(
            each.name, tuple(each.fixture_to_site), uri(each.mesh) if each.mesh else None, _rgba(each.color)
        )
        for each in description.fixtures
    )
    return Viewed(
        site,
        robot,
        description.urdf,
        tuple(description.base_to_site),
        lambda link: uri(shape) if (shape := shape_of.get(link)) else None,
        tuple(fixtures),
        floor_of(description),
    )


def _rgba(color: str) -> str:
    """Return "#rrggbb" as URDF's colour."""
    shades = (int((color or _FIXTURE_COLOR)[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return " ".join(f"{shade:.4g}" for shade in (*shades, 1.0))
