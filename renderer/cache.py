"""What was got or computed once, kept by its content in the user's cache folder."""

import contextlib
import hashlib
import os
import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from renderer import mesh as mesh_module
from renderer.mesh import Mesh, prepared
from robomesh.atomic_write import open_atomically, write_atomically

# Counted up whenever a mesh is prepared differently.
_VERSION = 4


def cache_folder() -> Path:
    """`robomesh/renderer` in the user's cache folder."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path("~/.cache").expanduser()) / "robomesh" / "renderer"


def stored_glb(sha256: str, folder: Path) -> bytes | None:
    """A mesh that came over the mesh before; None where it is not there, or not what it was."""
    try:
        data = (folder / f"{sha256}.glb").read_bytes()
    except OSError:
        return None
    return data if hashlib.sha256(data).hexdigest() == sha256 else None


def store_glb(data: bytes, folder: Path) -> None:
    """Keep a mesh by its hash; a folder that cannot be written costs time later, no more."""
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / f"{hashlib.sha256(data).hexdigest()}.glb", data, fsync=False)


def prepared_once(glb: bytes, *, color: str, folder: Path) -> Mesh:
    """As `renderer.mesh.prepared`, from the cache where it was done before.

    Raises:
        GlbError: If it is not GLB.
    """
    version = f"{_VERSION} {mesh_module.MOST_TRIANGLES} {color} "
    path = folder / f"{hashlib.sha256(version.encode() + glb).hexdigest()}.npz"
    names = [field.name for field in fields(Mesh)]
    unreadable = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)
    with contextlib.suppress(*unreadable), path.open("rb") as file, np.load(file) as stored:
        return Mesh(**{name: stored[name] for name in names})
    mesh = prepared(glb, color=color)
    arrays = {name: getattr(mesh, name) for name in names}
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with open_atomically(path, fsync=False) as new_file:
            np.savez(new_file, **arrays)
    return mesh
