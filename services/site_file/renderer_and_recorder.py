"""The site file's `[renderer]` and `[recorder]`."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from services.site_file.part import PART_CONFIG

Pixels = Annotated[int, Field(ge=64, le=4096, multiple_of=2)]

# Views of every robot, in addition to those of the site file.
ALWAYS_RENDERED = ("close", "far")


class FlightRecorder(BaseModel):
    """The last minutes of every robot, saved after an event; minutes = 0 disables it."""

    model_config = PART_CONFIG
    minutes: Annotated[float, Field(ge=0, le=120)] = 5
    # Minimum severity of an event that saves them, and the time that is added after it.
    severity: Literal["warning", "error", "critical"] = "error"
    after_s: Annotated[float, Field(ge=0, le=600)] = 30


class Split(BaseModel):
    """Limits at which a recording continues in a new file."""

    model_config = PART_CONFIG
    mib: Annotated[float, Field(ge=1, le=65536)] = 1024
    minutes: Annotated[float, Field(ge=0.1, le=1440)] = 60


class FreeSpace(BaseModel):
    """Free space below which the recorder warns, drops video, and drops all but robot states."""

    model_config = PART_CONFIG
    warn_mib: Annotated[float, Field(ge=0)] = 2048
    video_mib: Annotated[float, Field(ge=0)] = 512
    states_mib: Annotated[float, Field(ge=0)] = 64


class Recorder(BaseModel):
    """Folder and content of recordings."""

    model_config = PART_CONFIG
    folder: Path = Path("recordings")
    # Views recorded by default; each keeps the renderer busy during a recording.
    # None: one view that shows the whole arm.
    views: tuple[str, ...] | None = None
    flight: FlightRecorder = FlightRecorder()
    split: Split = Split()
    free: FreeSpace = FreeSpace()


class Renderer(BaseModel):
    """Rendered views, their size and quality."""

    model_config = PART_CONFIG
    views: tuple[str, ...] = ("front", "top", "left", "free")
    # Even numbers: H.264 halves the resolution of colour.
    size: tuple[Pixels, Pixels] = (1280, 720)
    fps: Annotated[float, Field(ge=1, le=120)] = 30
    # Samples per pixel; 0: off.
    anti_aliasing: Literal[0, 2, 4, 8] = 4
    shading: Literal["fast", "full"] = "fast"
    # Index of the EGL device, on a machine with several GPUs.
    device: Annotated[int, Field(ge=0, le=63)] | None = None
    # Maximum number of views on request, in total for all robots.
    most_views: Annotated[int, Field(ge=0, le=256)] = 32
