"""Cache of received and prepared shapes in the user's cache folder, by content hash."""

import contextlib
import hashlib
import os
import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np

from renderer.shapes import prepare
from renderer.shapes.prepare import BufferGeometry, prepared
from robomesh.files.atomic_write import open_atomically, write_atomically

# Incremented with each change of the preparation of shapes.
_VERSION = 9


def cache_folder() -> Path:
    """Return the folder `robomesh/renderer` in the user's cache folder."""
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path("~/.cache").expanduser()) / "robomesh" / "renderer"


def stored_glb(sha256: str, folder: Path) -> bytes | None:
    """Return a shape file received before; None if it is missing or damaged."""
    try:
        data = (folder / f"{sha256}.glb").read_bytes()
    except OSError:
        return None
    return data if hashlib.sha256(data).hexdigest() == sha256 else None


def store_glb(data: bytes, folder: Path) -> None:
    """Store a shape file by its hash; if the folder cannot be written, it is received again next time."""
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        write_atomically(folder / f"{hashlib.sha256(data).hexdigest()}.glb", data, fsync=False)


def prepared_once(glb: bytes, *, color: str, folder: Path) -> BufferGeometry:
    """Return the result of `renderer.shapes.prepare.prepared`, from the cache if possible.

    Raises:
        GlbError: If it is not GLB.
    """
    version = f"{_VERSION} {prepare.MOST_TRIANGLES} {color} "
    path = folder / f"{hashlib.sha256(version.encode() + glb).hexdigest()}.npz"
    names = [field.name for field in fields(BufferGeometry)]
    unreadable = (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile)
    with contextlib.suppress(*unreadable), path.open("rb") as file, np.load(file) as stored:
        return BufferGeometry(**{name: stored[name] for name in names})
    geometry = prepared(glb, color=color)
    arrays = {name: getattr(geometry, name) for name in names}
    with contextlib.suppress(OSError):
        folder.mkdir(parents=True, exist_ok=True)
        with open_atomically(path, fsync=False) as new_file:
            np.savez(new_file, **arrays)
    return geometry
