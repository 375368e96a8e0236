"""The site file's `[renderer]`; the settings of the service extend it."""

from typing import Annotated, Literal

from pydantic import Field

from robomesh.contract.keys import CLOSE, FAR
from robots.schema.toml_table import TomlTable

Pixels = Annotated[int, Field(ge=64, le=4096, multiple_of=2)]

# Views of every robot, in addition to those of the site file.
ALWAYS_RENDERED = (CLOSE, FAR)


class Renderer(TomlTable):
    """Rendered views, their size and quality.

    Attributes:
        views: Cameras of the robots' descriptions that every robot has as views.
        size: Width and height, even numbers [px].
        fps: Pictures a second.
        anti_aliasing: Samples per pixel; 0: off.
        shading: `full` also draws shadows on robots and fixtures.
        device: Number of the EGL device, on a machine with several GPUs; absent: the first GPU that
            works, or software.
        most_views: Largest number of requested views, for all robots together.
    """

    views: tuple[str, ...] = ("front", "top", "left", "free")
    # Even numbers: H.264 halves the resolution of colour.
    size: tuple[Pixels, Pixels] = (1280, 720)
    fps: Annotated[float, Field(ge=1, le=120)] = 30
    anti_aliasing: Literal[0, 2, 4, 8] = 4
    shading: Literal["fast", "full"] = "fast"
    device: Annotated[int, Field(ge=0, le=63)] | None = None
    most_views: Annotated[int, Field(ge=0, le=256)] = 32
