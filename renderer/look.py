"""What a description makes of a robot's pictures: its links, its cameras, how much room it needs."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bus.schemas.robomesh_pb2 import Description, Vector3, View
from renderer.cameras import Camera, fitted
from renderer.chain import Chain, placements, reach, read_chain
from renderer.errors import UnknownViewError
from renderer.scene import Part, Scene

FloatArray = NDArray[np.float64]

FREE = "free"
# Follows the arm and has nothing written on it: for the small pictures of a list.
CLOSE = "close"
# From the front right and a little above: waist, shoulder and elbow all show.
_FREE_DIRECTION = np.array([1.5, -1.5, 0.7])
# A long lens: what comes nearer does not take the picture's room from the rest.
_FREE_FIELD_OF_VIEW = float(np.deg2rad(24.0))
# How far a link's body comes beyond its frame's origin, over the size of the arm's room.
_BODY = 0.03
_SIDES = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (0.0, 1.0)])


@dataclass(frozen=True, eq=False)
class Look:
    """A robot, ready to be placed in pictures.

    Attributes:
        description: What the mesh tells of it.
        meshes: Name of each link's mesh in the drawing.
        base_to_site: (4, 4).
        center: (3,) of the room that it needs, in the site's frame [m].
        radius: Of that room [m].
        cameras: By view, for one aspect.
    """

    description: Description
    chain: Chain
    meshes: Mapping[str, str]
    base_to_site: FloatArray
    center: FloatArray
    radius: float
    cameras: Mapping[str, Camera]


def look_of(description: Description, *, aspect: float) -> Look:
    """How a robot is drawn.

    Args:
        aspect: The pictures' width over their height.

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
    body = _BODY * float(np.linalg.norm(highest - lowest))
    # Bodies come beyond their origins to every side but the floor's.
    room = np.concatenate([points + body * side for side in _SIDES])
    center = (lowest + highest) / 2.0
    cameras = {view.name: _camera(view, room, aspect, base_to_site) for view in description.views}
    if FREE not in cameras:
        cameras[FREE] = _free_camera(room, center, aspect, base_to_site)
    cameras.setdefault(CLOSE, cameras[FREE])
    return Look(
        description=description,
        chain=chain,
        meshes={link.name: mesh_name(link) for link in description.links if link.mesh},
        base_to_site=base_to_site,
        center=_moved(base_to_site, center[None])[0],
        radius=float(np.linalg.norm(room - center, axis=1).max()),
        cameras=cameras,
    )


def mesh_name(link: Description.Link) -> str:
    """Name of a link's mesh in the drawing: by content, so that robots of one kind share it."""
    return f"{link.mesh_sha256} {link.color}"


def home_placements(look: Look) -> dict[str, FloatArray]:
    """(4, 4) link to site of every link, all joints at home."""
    home = {joint.name: joint.home for joint in look.description.joints}
    return {
        link: look.base_to_site @ link_to_base for link, link_to_base in placements(look.chain, home).items()
    }


def scene_of(look: Look, link_placements: Mapping[str, FloatArray], *, stale: bool) -> Scene:
    """A scene with one robot in it.

    Args:
        link_placements: (4, 4) link to site by link; a link that is not there is not drawn.
    """
    return Scene(
        parts=tuple(
            Part(mesh, link_placements[link]) for link, mesh in look.meshes.items() if link in link_placements
        ),
        center=look.center,
        radius=look.radius,
        floor=float(look.base_to_site[2, 3]),
        stale=float(stale),
    )


def camera_of(look: Look, view: str) -> Camera:
    """A view's camera.

    Raises:
        UnknownViewError: If the robot has no such view.
    """
    try:
        return look.cameras[view]
    except KeyError:
        raise UnknownViewError(view, look.cameras) from None


def _camera(view: View, room: FloatArray, aspect: float, base_to_site: FloatArray) -> Camera:
    """A view of the description; orthographic ones get the scale at which the whole room shows."""
    eye, target, up = _array(view.eye), _array(view.target), _array(view.up)
    if not up.any():
        up = np.array([0.0, 0.0, 1.0])
    if view.projection == View.ORTHOGRAPHIC:
        camera = fitted(Camera(eye, target, up, half_height=1.0), aspect, room)
    else:
        camera = Camera(eye, target, up)
    return _placed(camera, base_to_site)


def _free_camera(room: FloatArray, center: FloatArray, aspect: float, base_to_site: FloatArray) -> Camera:
    up = np.array([0.0, 0.0, 1.0])
    camera = Camera(center + _FREE_DIRECTION, center, up, field_of_view=_FREE_FIELD_OF_VIEW)
    return _placed(fitted(camera, aspect, room), base_to_site)


def _placed(camera: Camera, base_to_site: FloatArray) -> Camera:
    eye, target = _moved(base_to_site, np.array([camera.eye, camera.target]))
    return replace(camera, eye=eye, target=target, up=base_to_site[:3, :3] @ camera.up)


def _frames_by_link(description: Description) -> dict[str, FloatArray]:
    """(k, 3) origins of the tool and the named frames, by the link that carries them."""
    origins: dict[str, FloatArray] = {}
    for frame in description.frames:
        origin = np.array(frame.frame_to_link).reshape(4, 4)[:3, 3]
        origins[frame.link] = np.concatenate([origins.get(frame.link, np.empty((0, 3))), [origin]])
    return origins


def _moved(transform: FloatArray, points: FloatArray) -> FloatArray:
    moved: FloatArray = points @ transform[:3, :3].T + transform[:3, 3]
    return moved


def _array(vector: Vector3) -> FloatArray:
    numbers: FloatArray = np.array([vector.x, vector.y, vector.z])
    return numbers
