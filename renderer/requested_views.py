"""Views as they are drawn: the renderer's own, and those that somebody asks for.

Who asks for the same gets the same one: its name is made of what was asked.
"""

import hashlib
import math
from dataclasses import dataclass

from renderer.appearance import Look
from renderer.errors import UnknownViewError, ViewRequestError
from renderer.views import camera_from, camera_of, view_names
from robomesh.schemas.robomesh_pb2 import View, ViewRequest

# A standing view for slow links.
FAR = "far"
IMAGE_HZ = 5.0
_FAR_SIZE, _FAR_FPS, _FAR_BITS_PER_S = (640, 360), 15.0, 250e3

_LEAST_PX, _MOST_PX, _MOST_PIXELS = 64, 1920, 1920 * 1080
_LEAST_FPS, _MOST_FPS = 1.0, 60.0
# Of 1920 x 1080 a drawing and an encoder hold 150 MB, however slow it is.
_LEAST_COUNTED_FPS = 10.0
_LEAST_BITS_PER_S, _MOST_BITS_PER_S = 50e3, 100e6
_MOST_POINTS = 5000
_NAME_LENGTH = 10


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One view of a robot, as it is drawn.

    Attributes:
        name: Of its topics, video/<name> and image/<name>.
        of: The robot's view whose camera it is; empty: `view` is.
        size: Width and height [px].
        fps: Highest rate of its video [1/s].
        image_hz: Highest rate of its pictures [1/s].
        most_bits_per_s: Of its video; 0: no limit.
        show: What is drawn beside robots and fixtures.
        requested: It ends when nobody watches it.
    """

    name: str
    of: str
    size: tuple[int, int]
    fps: float
    view: View | None = None
    image_hz: float = IMAGE_HZ
    most_bits_per_s: float = 0.0
    show: ViewRequest.Show | None = None
    requested: bool = False

    @property
    def pixels_per_s(self) -> float:
        """What it costs, at its full rate; a slow one holds as much memory as another."""
        return self.size[0] * self.size[1] * max(self.fps, _LEAST_COUNTED_FPS)

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.size[0] / self.size[1]


def standing(name: str, *, size: tuple[int, int], fps: float) -> Shot:
    """One of the renderer's own views."""
    return Shot(name=name, of=name, size=size, fps=fps)


def far(of: str, *, size: tuple[int, int], fps: float) -> Shot:
    """The view for slow links: small, slow, and of few bits.

    Args:
        of: The view whose camera it is.
        size: Of the renderer's other views, which is not exceeded.
    """
    return Shot(
        name=FAR,
        of=of,
        size=min(size, _FAR_SIZE),
        fps=min(fps, _FAR_FPS),
        most_bits_per_s=_FAR_BITS_PER_S,
    )


def requested(request: ViewRequest, look: Look, *, first: str, size: tuple[int, int], fps: float) -> Shot:
    """What somebody asks for, looked at.

    Args:
        first: The view that `far` is of.
        size: Where the request names none.
        fps: Where the request names none.

    Raises:
        RendererError: With what is wrong, and what would be right.
    """
    own = request.HasField("view")
    if own == bool(request.of):
        raise ViewRequestError("a view of one's own needs one of `view`, a camera, and `of`, a view's name")
    width, height = _size(request, size)
    rate = _between("fps", request.fps, _LEAST_FPS, _MOST_FPS) if request.fps else min(fps, _MOST_FPS)
    bits = request.most_bits_per_s
    if bits:
        bits = _between("most_bits_per_s", bits, _LEAST_BITS_PER_S, _MOST_BITS_PER_S)
    _check_show(request.show, look)
    view: View | None = None
    of = first if request.of == FAR else request.of
    if own:
        view = View()
        view.CopyFrom(request.view)
        view.ClearField("name")
        camera_from(look, view, aspect=width / height)
    else:
        known = view_names(look)
        if of not in known:
            raise UnknownViewError(of, (*known, FAR))
        camera_of(look, of, aspect=width / height)
    same = ViewRequest(
        view=view, width=width, height=height, fps=rate, of=of, most_bits_per_s=bits, show=request.show
    )
    digest = hashlib.sha256(same.SerializeToString(deterministic=True)).hexdigest()
    return Shot(
        name=f"free-{digest[:_NAME_LENGTH]}",
        of=of,
        view=view,
        size=(width, height),
        fps=rate,
        image_hz=rate,
        most_bits_per_s=bits,
        show=request.show if request.HasField("show") else None,
        requested=True,
    )


def _size(request: ViewRequest, own: tuple[int, int]) -> tuple[int, int]:
    width, height = request.width, request.height
    if not width and not height:
        width, height = own
    elif not height:
        height = 2 * round(width * own[1] / own[0] / 2)
    elif not width:
        width = 2 * round(height * own[0] / own[1] / 2)
    possible = (
        min(width, height) >= _LEAST_PX
        and max(width, height) <= _MOST_PX
        and width * height <= _MOST_PIXELS
        and width % 2 == height % 2 == 0
    )
    if not possible and (width, height) != own:
        raise ViewRequestError(
            f"a view of {width} x {height} pixels: even numbers from {_LEAST_PX} to {_MOST_PX} are possible, "
            "and as many pixels as 1920 x 1080 has"
        )
    return width, height


def _between(name: str, value: float, least: float, most: float) -> float:
    if not least <= value <= most:
        raise ViewRequestError(f"{name} {value:g}: {least:g} to {most:g} is possible, or 0: as it comes")
    return value


def _check_show(show: ViewRequest.Show, look: Look) -> None:
    joints = len(look.description.joints)
    if show.ghost and len(show.ghost) != joints:
        raise ViewRequestError(f"a ghost of {len(show.ghost)} joint positions: the robot has {joints} joints")
    if len(show.path) > _MOST_POINTS:
        raise ViewRequestError(f"a path of {len(show.path)} points: {_MOST_POINTS} at most are drawn")
    numbers = [*show.ghost, *(value for point in show.path for value in (point.x, point.y, point.z))]
    if not all(map(math.isfinite, numbers)):
        raise ViewRequestError("a ghost or path with a number that is not finite")
