"""A robot's appearance from its description: links, shapes, fixtures, workspace."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.scene.chain import Chain, placements, reach, read_chain
from renderer.scene.scene import Part, square_m
from robomesh.schemas.robomesh_pb2 import Description

FloatArray = NDArray[np.float64]

# Extent of a link's body beyond its frame's origin, over the size of the workspace.
_BODY = 0.03
# Lower bound of that [m]: a robot with D-H rows of zeros has no workspace, but bodies.
_LEAST_BODY = 0.1
_SIDES = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (0.0, 1.0)])


@dataclass(frozen=True, eq=False)
class Appearance:
    """The data of a robot that do not change while it moves.

    Attributes:
        description: Its published description.
        shapes: Name of each link's shape in the drawing.
        fixtures: Fixtures of its cell.
        base_to_site: (4, 4).
        workspace: (n, 3) points around everything that it can reach, in its base frame [m].
        center: (3,) centre of the workspace, in the site's frame [m].
        radius: Radius of the workspace [m].
        floor: Height of its cell's floor, in the site's frame [m]; None: no floor.
    """

    description: Description
    chain: Chain
    shapes: Mapping[str, str]
    fixtures: tuple[Part, ...]
    base_to_site: FloatArray
    workspace: FloatArray
    center: FloatArray
    radius: float
    floor: float | None

    @property
    def square_m(self) -> float:
        """Width of a small square of the floor in its pictures [m]."""
        return square_m(self.radius)


def appearance_of(description: Description) -> Appearance:
    """Return a robot's appearance.

    Raises:
        ChainError: If its URDF is not a tree of joints.
    """
    chain = read_chain(description.urdf)
    base_to_site = np.eye(4)
    if len(description.base_to_site) == 16:
        base_to_site = np.array(description.base_to_site).reshape(4, 4)
    points = reach(chain, _frames_by_link(description))
    # The floor is at the robot's base: positions below it are ignored.
    points = points[points[:, 2] >= 0.0]
    lowest, highest = points.min(axis=0), points.max(axis=0)
    body = max(_BODY * float(np.linalg.norm(highest - lowest)), _LEAST_BODY)
    # Bodies extend beyond their origins to every side except downwards.
    workspace = np.concatenate([points + body * side for side in _SIDES])
    center = (lowest + highest) / 2.0
    return Appearance(
        description=description,
        chain=chain,
        shapes={link.name: shape_name(link) for link in description.links if link.mesh},
        fixtures=tuple(
            Part(
                shape_name(fixture),
                np.array(fixture.fixture_to_site).reshape(4, 4),
                name=fixture.name,
            )
            for fixture in description.fixtures
        ),
        base_to_site=base_to_site,
        workspace=workspace,
        center=base_to_site[:3, :3] @ center + base_to_site[:3, 3],
        radius=float(np.linalg.norm(workspace - center, axis=1).max()),
        floor=floor_of(description),
    )


def floor_of(description: Description) -> float | None:
    """Return the height of the floor of a robot's cell, in the site's frame [m]; None: no floor."""
    if not description.HasField("floor"):
        # An older publisher sends no floor: the floor is at the robot's base.
        return description.base_to_site[11] if len(description.base_to_site) == 16 else 0.0
    return description.floor.height if description.floor.HasField("height") else None


def shape_name(body: Description.Link | Description.Fixture) -> str:
    """Return the name of a shape in the drawing, by content, so that robots of one model share it."""
    return f"{body.mesh_sha256} {body.color}"


def home_placements(appearance: Appearance) -> dict[str, FloatArray]:
    """Return (4, 4) link to site of every link, all joints at home."""
    return placements_at(appearance, {joint.name: joint.home for joint in appearance.description.joints})


def placements_at(appearance: Appearance, positions: Mapping[str, float]) -> dict[str, FloatArray]:
    """Return (4, 4) link to site of every link.

    Args:
        positions: By joint [rad] or [m]; joints without a position are at 0.
    """
    return {
        link: appearance.base_to_site @ link_to_base
        for link, link_to_base in placements(appearance.chain, positions).items()
    }


def frame_placements(
    appearance: Appearance, link_placements: Mapping[str, FloatArray]
) -> dict[str, FloatArray]:
    """Return (4, 4) frame to site of the tool and of every named frame on a link with a placement."""
    return {
        frame.name: link_placements[frame.link] @ np.array(frame.frame_to_link).reshape(4, 4)
        for frame in appearance.description.frames
        if frame.link in link_placements
    }


def _frames_by_link(description: Description) -> dict[str, FloatArray]:
    """Return (k, 3) origins of the tool and the named frames, by the link that carries them."""
    origins: dict[str, FloatArray] = {}
    for frame in description.frames:
        origin = np.array(frame.frame_to_link).reshape(4, 4)[:3, 3]
        origins[frame.link] = np.concatenate([origins.get(frame.link, np.empty((0, 3))), [origin]])
    return origins
