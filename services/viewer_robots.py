"""Robots as other people's viewers have them: from a description, with meshes where the viewer finds them."""

from collections.abc import Callable

from renderer.appearance import floor_of
from robomesh.schemas.robomesh_pb2 import Description
from robots.urdf.viewers import Fixture, Viewed


def meshes_of(description: Description) -> dict[str, str]:
    """The hash (SHA-256, hex) of each mesh that a description names, by the mesh's name."""
    hashes = {link.mesh: link.mesh_sha256 for link in description.links}
    hashes |= {fixture.mesh: fixture.mesh_sha256 for fixture in description.fixtures}
    hashes.pop("", None)
    return hashes


def viewed(site: str, robot: str, description: Description, uri: Callable[[str], str | None]) -> Viewed:
    """A robot to be shown, and what stands in its cell.

    Args:
        uri: Where a mesh is, by its name; None: nowhere.
    """
    mesh_of = {link.name: link.mesh for link in description.links}
    fixtures = (
        Fixture(each.name, tuple(each.fixture_to_site), uri(each.mesh) if each.mesh else None)
        for each in description.fixtures
    )
    return Viewed(
        site,
        robot,
        description.urdf,
        tuple(description.base_to_site),
        lambda link: uri(mesh) if (mesh := mesh_of.get(link)) else None,
        tuple(fixtures),
        floor_of(description),
    )
