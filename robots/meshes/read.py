"""Mesh files by their ending."""

from collections.abc import Callable, Mapping
from pathlib import Path

from robots.errors import MeshError
from robots.meshes.mesh import Mesh
from robots.meshes.three_ds import read_3ds
from robots.meshes.vrml import read_vrml

READERS: Mapping[str, Callable[[Path], Mesh]] = {".wrl": read_vrml, ".vrml": read_vrml, ".3ds": read_3ds}


def read_mesh(path: Path) -> Mesh:
    """A mesh file's content, in its own units and axes.

    Raises:
        MeshError: If its ending is not one that is read, or the file is not what its ending says.
    """
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise MeshError(path, f"ending {path.suffix!r} is not read; {', '.join(READERS)} are")
    return reader(path)
