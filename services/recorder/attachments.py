"""Attachments of a recording: the robot's description and shapes, a picture, the site file."""

import asyncio
import base64
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from robomesh.contract.header import Header
from robomesh.contract.keys import CLOSE, FAR, WHOLE_SITE, robot_key
from robomesh.errors import RobomeshError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import Session
from robots.descriptions.urdf.viewers import prefixed, without_joints

_SHAPE_WITHIN_S = 10.0
_PICTURE_WITHIN_S = 5.0
_PICTURES = (CLOSE, FAR)
# Keys of the site file with secret values.
_SECRET = re.compile(r"(?im)^(\s*[\w.-]*(?:password|secret|token|passphrase|key)[\w.-]*\s*=\s*).*$")
_SECRET_INLINE = re.compile(r"(?i)([\w-]*(?:password|secret|token|passphrase|key)[\w-]*\s*=\s*)\"[^\"]*\"")


@dataclass(frozen=True)
class Attachment:
    """An attachment of an MCAP file."""

    name: str
    media_type: str
    data: bytes


@dataclass(frozen=True)
class KnownRobot:
    """A robot's description and shapes.

    Attributes:
        header: Header of its description.
        prefix: Prefix of its links' frame names.
    """

    header: Header
    description: schema.Description
    shapes: dict[str, bytes]
    prefix: str

    @property
    def attachments(self) -> list[Attachment]:
        """Attachments of each file of the robot."""
        found = [Attachment(f"mesh/{name}", "model/gltf-binary", data) for name, data in self.shapes.items()]
        if self.description.robot_toml:
            found.append(Attachment("robot.toml", "application/toml", self.description.robot_toml.encode()))
        if self.description.urdf:
            found.append(Attachment("robot.urdf", "application/xml", self.description.urdf.encode()))
        return found


def without_secrets(site_file: str) -> str:
    """Return a site file's text without the values of passwords and keys."""
    return _SECRET_INLINE.sub(r'\1"..."', _SECRET.sub(r'\1"..."', site_file))


class DescriptionCache:
    """Descriptions and shapes of a site's robots, kept up to date so that a new recording starts with them.

    Args:
        on_known: Called with a robot's name when its description is complete or has changed.
    """

    def __init__(self, session: Session, site: str, on_known: Callable[[str], None]) -> None:
        self.known: dict[str, KnownRobot] = {}
        self._session, self._site = session, site
        self._on_known = on_known
        self._tasks: dict[str, asyncio.Task[None]] = {}
        # By content hash: robots of one model share their shapes.
        self._shapes: dict[str, bytes] = {}

    async def serve(self) -> None:
        """Receive descriptions until cancelled."""
        async with asyncio.TaskGroup() as group:
            key = robot_key(self._site, WHOLE_SITE, "description").replace("/-/", "/*/")
            async for sample in self._session.subscribe(key, newest=1000):
                robot = sample.parsed.robot
                try:
                    description = sample.message()
                except RobomeshError:
                    continue
                assert isinstance(description, schema.Description)
                if not description.HasField("replay"):
                    task = group.create_task(self._fetch_shapes(robot, sample.header, description))
                    self._tasks[robot] = task

    async def wait_for_shapes(self, robot: str, *, within_s: float) -> None:
        """Wait for shapes that are being fetched, at most this long."""
        if (task := self._tasks.get(robot)) is not None:
            await asyncio.wait([task], timeout=within_s)

    async def _fetch_shapes(self, robot: str, header: Header, description: schema.Description) -> None:
        shapes: dict[str, bytes] = {}
        hashes = {each.mesh: each.mesh_sha256 for each in description.links}
        hashes |= {each.mesh: each.mesh_sha256 for each in description.fixtures}
        for name, sha256 in hashes.items():
            if not name:
                continue
            if (data := self._shapes.get(sha256)) is None:
                try:
                    key = robot_key(self._site, robot, f"mesh/{name}")
                    data = await self._session.ask_bytes(key, timeout_s=_SHAPE_WITHIN_S)
                except RobomeshError:
                    continue  # the description still holds its name and hash
                self._shapes[sha256] = data
            shapes[name] = data
        self.known[robot] = KnownRobot(header, description, shapes, prefix=f"{self._site}/{robot}/")
        self._on_known(robot)


async def picture(session: Session, site: str, robot: str) -> Attachment | None:
    """Return a robot's current picture, or None if no renderer publishes one."""
    for view in _PICTURES:
        subscription = session.subscribe(robot_key(site, robot, f"image/{view}"), history=False)
        try:
            async with asyncio.timeout(_PICTURE_WITHIN_S):
                image: Any = (await anext(subscription)).message()
            return Attachment("thumbnail.jpg", "image/jpeg", image.data)
        except (TimeoutError, StopAsyncIteration, RobomeshError):
            continue
        finally:
            subscription.close()
    return None


def self_contained_urdf(robot: KnownRobot) -> str:
    """Return a robot's links, named as the frames, as URDF with embedded GLB meshes.

    A viewer that opens the file has no other source of meshes. The whole URDF is an attachment.
    """
    description = robot.description
    shape_of = {link.name: robot.shapes.get(link.mesh) for link in description.links}

    def uri(link: str) -> str | None:
        data = shape_of.get(link)
        return f"data:model/gltf-binary;base64,{base64.b64encode(data).decode()}" if data else None

    try:
        shown = without_joints(prefixed(description.urdf, robot.prefix, uri))
        return ET.tostring(shown, encoding="unicode")
    except ValueError:
        return description.urdf
