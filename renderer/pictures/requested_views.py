"""Specifications of views: the renderer's own, and requested ones.

A requested view's name is a hash of the request, so equal requests share one view.
"""

import hashlib
import math
from dataclasses import dataclass

from renderer.errors import UnknownViewError, ViewRequestError
from renderer.scene.appearance import Appearance
from renderer.scene.views import camera_from, camera_of, view_names
from robomesh import reason_codes as codes
from robomesh.contract.keys import FAR
from robomesh.schemas.robomesh_pb2 import View, ViewRequest

IMAGE_HZ = 5.0
_FAR_SIZE, _FAR_FPS, _FAR_BITS_PER_S = (640, 360), 15.0, 250e3

_LEAST_PX, _MOST_PX, _MOST_PIXELS = 64, 1920, 1920 * 1080
_LEAST_FPS, _MOST_FPS = 1.0, 60.0
# Lowest rate for which a view counts: at any rate, surface and encoder of 1920 x 1080 take 150 MB.
_LEAST_COUNTED_FPS = 10.0
_LEAST_BITS_PER_S, _MOST_BITS_PER_S = 50e3, 100e6
_MOST_POINTS = 5000
_NAME_LENGTH = 10


@dataclass(frozen=True, kw_only=True)
class ViewSpec:
    """The specification of one view of a robot.

    Attributes:
        name: The name in its topics, video/<name> and image/<name>.
        of: The robot's view that has the camera; empty if `view` has it.
        size: Width and height [px].
        fps: Highest rate of its video [1/s].
        view: A requested camera.
        image_hz: Highest rate of its pictures [1/s].
        most_bits_per_s: Highest bit rate of its video; 0: no limit.
        show: Additions to robots and fixtures, for example a trail.
        requested: It was requested, and ends when it has no subscribers.
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
        """Cost at the full rate; a slow view counts as 10 pictures a second because of its memory."""
        return self.size[0] * self.size[1] * max(self.fps, _LEAST_COUNTED_FPS)

    @property
    def aspect(self) -> float:
        """Width over height."""
        return self.size[0] / self.size[1]


def standard_view(name: str, *, size: tuple[int, int], fps: float) -> ViewSpec:
    """Return the specification of one of the renderer's own views."""
    return ViewSpec(name=name, of=name, size=size, fps=fps)


def low_rate_view(of: str, *, size: tuple[int, int], fps: float) -> ViewSpec:
    """Return the specification of the view for slow links: small, slow, with a low bit rate.

    Args:
        of: The view that provides the camera.
        size: Size of the renderer's other views, which is not exceeded.
    """
    return ViewSpec(
        name=FAR,
        of=of,
        size=min(size, _FAR_SIZE),
        fps=min(fps, _FAR_FPS),
        most_bits_per_s=_FAR_BITS_PER_S,
    )


def requested_view(
    request: ViewRequest, appearance: Appearance, *, first: str, size: tuple[int, int], fps: float
) -> ViewSpec:
    """Check a request and return the specification of its view.

    Args:
        first: The view that provides the camera of `far`.
        size: Default size.
        fps: Default rate.

    Raises:
        ViewError: If the request is invalid; the text says what is wrong and what is possible.
    """
    own = request.HasField("view")
    if own == bool(request.of):
        raise ViewRequestError(codes.VIEW_OR_OF())
    width, height = _size(request, size)
    rate = _between("fps", request.fps, _LEAST_FPS, _MOST_FPS) if request.fps else min(fps, _MOST_FPS)
    bits = request.most_bits_per_s
    if bits:
        bits = _between("most_bits_per_s", bits, _LEAST_BITS_PER_S, _MOST_BITS_PER_S)
    _check_show(request.show, appearance)
    view: View | None = None
    of = first if request.of == FAR else request.of
    if own:
        view = View()
        view.CopyFrom(request.view)
        view.ClearField("name")
        camera_from(appearance, view, aspect=width / height)
    else:
        known = view_names(appearance)
        if of not in known:
            raise UnknownViewError(of, (*known, FAR))
        camera_of(appearance, of, aspect=width / height)
    same = ViewRequest(
        view=view, width=width, height=height, fps=rate, of=of, most_bits_per_s=bits, show=request.show
    )
    digest = hashlib.sha256(same.SerializeToString(deterministic=True)).hexdigest()
    return ViewSpec(
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
        raise ViewRequestError(codes.VIEW_SIZE(width=width, height=height, least=_LEAST_PX, most=_MOST_PX))
    return width, height


def _between(name: str, value: float, least: float, most: float) -> float:
    if not least <= value <= most:
        raise ViewRequestError(codes.VIEW_VALUE(field=name, value=value, least=least, most=most))
    return value


def _check_show(show: ViewRequest.Show, appearance: Appearance) -> None:
    joints = len(appearance.description.joints)
    if show.ghost and len(show.ghost) != joints:
        raise ViewRequestError(codes.VIEW_GHOST(count=len(show.ghost), joints=joints))
    if len(show.path) > _MOST_POINTS:
        raise ViewRequestError(codes.VIEW_PATH(count=len(show.path), most=_MOST_POINTS))
    numbers = [*show.ghost, *(value for point in show.path for value in (point.x, point.y, point.z))]
    if not all(map(math.isfinite, numbers)):
        raise ViewRequestError(codes.VIEW_NOT_FINITE())
