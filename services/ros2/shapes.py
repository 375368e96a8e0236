"""Robots' shapes as files, because RViz cannot fetch them from the mesh."""

import asyncio
import hashlib
import logging
from pathlib import Path

from robomesh.contract.keys import robot_key
from robomesh.errors import RobomeshError
from robomesh.files.atomic_write import write_atomically
from robomesh.schemas.robomesh_pb2 import Description
from robomesh.wire.session import Session
from services.viewers.robots import shapes_of

log = logging.getLogger(__name__)

_WITHIN_S = 10.0


class ShapeFiles:
    """Folder of GLB files, named by their content's hash."""

    def __init__(self, session: Session, folder: Path) -> None:
        self._session, self._folder = session, folder

    async def of(self, site: str, robot: str, description: Description) -> dict[str, str]:
        """Return the URI of each shape, by the shape's name; without those that cannot be fetched."""
        hashes = shapes_of(description).items()
        paths = {shape: await self._path(site, robot, shape, sha256) for shape, sha256 in hashes}
        return {shape: path.as_uri() for shape, path in paths.items() if path}

    async def _path(self, site: str, robot: str, shape: str, sha256: str) -> Path | None:
        path = self._folder / f"{sha256}.glb"
        # The hash comes from another program: check it before it is part of a path.
        if len(sha256) != 64 or not sha256.isalnum():
            return None
        if await asyncio.to_thread(path.exists):
            return path
        try:
            data = await self._session.ask_bytes(robot_key(site, robot, f"mesh/{shape}"), timeout_s=_WITHIN_S)
            if hashlib.sha256(data).hexdigest() != sha256:
                return None
            await asyncio.to_thread(_save, path, data)
        except (RobomeshError, OSError) as error:
            log.warning("no mesh %s of %s/%s: %s", shape, site, robot, error)
            return None
        return path


def _save(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, data, mode=0o666, fsync=False)
