"""What the site file says of pictures and records: `[renderer]` and `[recorder]`."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from services.site_file.part import Quiet

Pixels = Annotated[int, Field(ge=64, le=4096, multiple_of=2)]

# Views of every robot, beside those that the site file names.
ALWAYS_RENDERED = ("close", "far")


class FlightRecorder(BaseModel):
    """The last minutes of every robot, kept when something happens; minutes = 0: no flight recorder."""

    model_config = Quiet
    minutes: Annotated[float, Field(ge=0, le=120)] = 5
    # Of an event that has them saved, with what follows.
    severity: Literal["warning", "error", "critical"] = "error"
    after_s: Annotated[float, Field(ge=0, le=600)] = 30


class Split(BaseModel):
    """When a recording goes on in a next file."""

    model_config = Quiet
    mib: Annotated[float, Field(ge=1, le=65536)] = 1024
    minutes: Annotated[float, Field(ge=0.1, le=1440)] = 60


class FreeSpace(BaseModel):
    """Free space below which it is told, video is given up, and all but the robots' states is."""

    model_config = Quiet
    warn_mib: Annotated[float, Field(ge=0)] = 2048
    video_mib: Annotated[float, Field(ge=0)] = 512
    states_mib: Annotated[float, Field(ge=0)] = 64


class Recorder(BaseModel):
    """Where recordings go, and what goes into them."""

    model_config = Quiet
    folder: Path = Path("recordings")
    # Whose video is recorded unless one asks otherwise, as each keeps the renderer at work for as long;
    # not said: one that shows the whole arm.
    views: tuple[str, ...] | None = None
    flight: FlightRecorder = FlightRecorder()
    split: Split = Split()
    free: FreeSpace = FreeSpace()


class Renderer(BaseModel):
    """Which views are rendered, how large and how well."""

    model_config = Quiet
    views: tuple[str, ...] = ("front", "top", "left", "free")
    # H.264 halves the resolution of colour.
    size: tuple[Pixels, Pixels] = (1280, 720)
    fps: Annotated[float, Field(ge=1, le=120)] = 30
    # Samples a pixel; 0: none.
    anti_aliasing: Literal[0, 2, 4, 8] = 4
    shading: Literal["fast", "full"] = "fast"
    # Of the machine's EGL devices, where it has several GPUs.
    device: Annotated[int, Field(ge=0, le=63)] | None = None
    # That may be asked for beside these, of all robots together.
    most_views: Annotated[int, Field(ge=0, le=256)] = 32
