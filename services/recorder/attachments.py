"""What a recording explains itself with: the robot's description and meshes, a picture, the site file."""

import asyncio
import base64
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from robomesh.errors import BusError
from robomesh.header import Header
from robomesh.keys import WHOLE_SITE, robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session
from robots.urdf.viewers import prefixed

_MESH_WITHIN_S = 10.0
_PICTURE_WITHIN_S = 5.0
_PICTURES = ("close", "far")
# What nobody but the site needs to know: values of keys that sound like it.
_SECRET = re.compile(r"(?im)^(\s*[\w.-]*(?:password|secret|token|passphrase|key)[\w.-]*\s*=\s*).*$")
_SECRET_INLINE = re.compile(r"(?i)([\w-]*(?:password|secret|token|passphrase|key)[\w-]*\s*=\s*)\"[^\"]*\"")


@dataclass(frozen=True)
class Attachment:
    """Something attached to a file."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True)
class Explained:
    """What is known of a robot.

    Attributes:
        header: Of its description.
        prefix: What its links' names begin with, as frames.
    """

    header: Header
    description: schema.Description
    meshes: dict[str, bytes]
    prefix: str

    @property
    def attachments(self) -> list[Attachment]:
        """What a file of the robot has with it."""
        found = [Attachment(f"mesh/{name}", "model/gltf-binary", data) for name, data in self.meshes.items()]
        if self.description.robot_toml:
            found.append(Attachment("robot.toml", "application/toml", self.description.robot_toml.encode()))
        if self.description.urdf:
            found.append(Attachment("robot.urdf", "application/xml", self.description.urdf.encode()))
        return found


def without_secrets(site_file: str) -> str:
    """A site file's text, values of passwords and keys left out."""
    return _SECRET_INLINE.sub(r'\1"..."', _SECRET.sub(r'\1"..."', site_file))


class Explainer:
    """Follows what a site's robots are, so that a recording that begins has it at once.

    Args:
        on_explained: Told when a robot is known, or known anew.
    """

    def __init__(self, session: Session, site: str, on_explained: Callable[[str], None]) -> None:
        self.known: dict[str, Explained] = {}
        self._session, self._site = session, site
        self._on_explained = on_explained
        self._asking: dict[str, asyncio.Task[None]] = {}
        # By content: a site has many robots of a kind.
        self._meshes: dict[str, bytes] = {}

    async def serve(self) -> None:
        """Follow descriptions until cancelled."""
        async with asyncio.TaskGroup() as group:
            key = robot_key(self._site, WHOLE_SITE, "description").replace("/-/", "/*/")
            async for sample in self._session.subscribe(key, newest=1000):
                robot = sample.parsed.robot
                try:
                    description = sample.message()
                except BusError:
                    continue
                assert isinstance(description, schema.Description)
                if not description.HasField("replay"):
                    task = group.create_task(self._explain(robot, sample.header, description))
                    self._asking[robot] = task

    async def settled(self, robot: str, *, within_s: float) -> None:
        """Wait for meshes that were asked for, a little."""
        if (task := self._asking.get(robot)) is not None:
            await asyncio.wait([task], timeout=within_s)

    async def _explain(self, robot: str, header: Header, description: schema.Description) -> None:
        meshes: dict[str, bytes] = {}
        hashes = {each.mesh: each.mesh_sha256 for each in description.links}
        hashes |= {each.mesh: each.mesh_sha256 for each in description.fixtures}
        for name, sha256 in hashes.items():
            if not name:
                continue
            if (data := self._meshes.get(sha256)) is None:
                try:
                    key = robot_key(self._site, robot, f"mesh/{name}")
                    data = await self._session.ask_bytes(key, timeout_s=_MESH_WITHIN_S)
                except BusError:
                    continue  # the description tells its name and hash
                self._meshes[sha256] = data
            meshes[name] = data
        self.known[robot] = Explained(header, description, meshes, prefix=f"{self._site}/{robot}/")
        self._on_explained(robot)


async def picture(session: Session, site: str, robot: str) -> Attachment | None:
    """How a robot looks now; None: nobody draws it."""
    for view in _PICTURES:
        subscription = session.subscribe(robot_key(site, robot, f"image/{view}"), history=False)
        try:
            async with asyncio.timeout(_PICTURE_WITHIN_S):
                image: Any = (await anext(subscription)).message()
            return Attachment("thumbnail.jpg", "image/jpeg", image.data)
        except (TimeoutError, StopAsyncIteration, BusError):
            continue
        finally:
            subscription.close()
    return None


def for_viewers(explained: Explained) -> str:
    """A robot's URDF with links named as the frames are, and each link's mesh in it as GLB.

    A viewer that opens the file has nothing else to take a mesh from.
    """
    description = explained.description
    mesh_of = {link.name: explained.meshes.get(link.mesh) for link in description.links}

    def uri(link: str) -> str | None:
        data = mesh_of.get(link)
        return f"data:model/gltf-binary;base64,{base64.b64encode(data).decode()}" if data else None

    try:
        return ET.tostring(prefixed(description.urdf, explained.prefix, uri), encoding="unicode")
    except ValueError:
        return description.urdf
