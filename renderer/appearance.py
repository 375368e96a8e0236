"""What a description makes of a robot's pictures: its links, how much room it needs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.chain import Chain, placements, reach, read_chain
from renderer.scene import Part, square_m
from robomesh.schemas.robomesh_pb2 import Description

FloatArray = NDArray[np.float64]

# How far a link's body comes beyond its frame's origin, over the size of the arm's room.
_BODY = 0.03
# And at least [m]: a robot whose rows are all still zero has no room, but a body.
_LEAST_BODY = 0.1
_SIDES = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (0.0, 1.0)])


@dataclass(frozen=True, eq=False)
class Look:
    """A robot, ready to be placed in pictures.

    Attributes:
        description: What the mesh tells of it.
        meshes: Name of each link's mesh in the drawing.
        fixtures: What stands around it.
        base_to_site: (4, 4).
        room: (n, 3) points that hold all that it may reach, in its base frame [m].
        center: (3,) of the room, in the site's frame [m].
        radius: Of the room [m].
        floor: Height of the floor of its cell, in the site's frame [m]; None: there is none.
    """

    description: Description
    chain: Chain
    meshes: Mapping[str, str]
    fixtures: tuple[Part, ...]
    base_to_site: FloatArray
    room: FloatArray
    center: FloatArray
    radius: float
    floor: float | None

    @property
    def square_m(self) -> float:
        """Width of a small square of the floor in its pictures [m]."""
        return square_m(self.radius)


def look_of(description: Description) -> Look:
    """How a robot is drawn.

    Raises:
        ChainError: If its URDF is not a chain.
    """
    chain = read_chain(description.urdf)
    base_to_site = np.eye(4)
    if len(description.base_to_site) == 16:
        base_to_site = np.array(description.base_to_site).reshape(4, 4)
    points = reach(chain, _frames_by_link(description))
    # A robot's floor is where it stands: what would be below is not drawn for.
    points = points[points[:, 2] >= 0.0]
    lowest, highest = points.min(axis=0), points.max(axis=0)
    body = max(_BODY * float(np.linalg.norm(highest - lowest)), _LEAST_BODY)
    # Bodies come beyond their origins to every side but the floor's.
    room = np.concatenate([points + body * side for side in _SIDES])
    center = (lowest + highest) / 2.0
    return Look(
        description=description,
        chain=chain,
        meshes={link.name: mesh_name(link) for link in description.links if link.mesh},
        fixtures=tuple(
            Part(
                mesh_name(fixture),
                np.array(fixture.fixture_to_site).reshape(4, 4),
                name=fixture.name,
            )
            for fixture in description.fixtures
        ),
        base_to_site=base_to_site,
        room=room,
        center=base_to_site[:3, :3] @ center + base_to_site[:3, 3],
        radius=float(np.linalg.norm(room - center, axis=1).max()),
        floor=floor_of(description),
    )


def floor_of(description: Description) -> float | None:
    """Height of the floor of a robot's cell, in the site's frame [m]; None: there is none."""
    if not description.HasField("floor"):
        # An older publisher sends no floor: the floor is at the robot's base.
        return description.base_to_site[11] if len(description.base_to_site) == 16 else 0.0
    return description.floor.height if description.floor.HasField("height") else None


def mesh_name(body: Description.Link | Description.Fixture) -> str:
    """Name of a mesh in the drawing: by content, so that robots of one kind share it."""
    return f"{body.mesh_sha256} {body.color}"


def home_placements(look: Look) -> dict[str, FloatArray]:
    """(4, 4) link to site of every link, all joints at home."""
    return placements_at(look, {joint.name: joint.home for joint in look.description.joints})


def placements_at(look: Look, positions: Mapping[str, float]) -> dict[str, FloatArray]:
    """(4, 4) link to site of every link.

    Args:
        positions: By joint [rad] or [m]; one that is not named stands at 0.
    """
    return {
        link: look.base_to_site @ link_to_base
        for link, link_to_base in placements(look.chain, positions).items()
    }


def frame_placements(look: Look, link_placements: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """(4, 4) frame to site of the tool and every named frame whose link is placed."""
    return {
        frame.name: link_placements[frame.link] @ np.array(frame.frame_to_link).reshape(4, 4)
        for frame in look.description.frames
        if frame.link in link_placements
    }


def _frames_by_link(description: Description) -> dict[str, FloatArray]:
    """(k, 3) origins of the tool and the named frames, by the link that carries them."""
    origins: dict[str, FloatArray] = {}
    for frame in description.frames:
        origin = np.array(frame.frame_to_link).reshape(4, 4)[:3, 3]
        origins[frame.link] = np.concatenate([origins.get(frame.link, np.empty((0, 3))), [origin]])
    return origins
