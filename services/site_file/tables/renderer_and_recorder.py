"""The site file's `[renderer]` and `[recorder]`."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, Field

from protocol_gateway.seam.table import PART_CONFIG
from robomesh.contract.keys import CLOSE, FAR

Pixels = Annotated[int, Field(ge=64, le=4096, multiple_of=2)]

# Views of every robot, in addition to those of the site file.
ALWAYS_RENDERED = (CLOSE, FAR)


class FlightRecorder(BaseModel):
    """The last minutes of every robot, saved after an event.

    Attributes:
        minutes: Time that is kept [min]; 0: no flight recorder.
        severity: Least severity of an event that saves it.
        after_s: Time after the event that is added [s].
    """

    model_config = PART_CONFIG
    minutes: Annotated[float, Field(ge=0, le=120)] = 5
    severity: Literal["warning", "error", "critical"] = "error"
    after_s: Annotated[float, Field(ge=0, le=600)] = 30


class Split(BaseModel):
    """Limits at which a recording continues in a new file.

    Attributes:
        mib: Size of a file [MiB].
        minutes: Duration of a file [min].
    """

    model_config = PART_CONFIG
    mib: Annotated[float, Field(ge=1, le=65536)] = 1024
    minutes: Annotated[float, Field(ge=0.1, le=1440)] = 60


class FreeSpace(BaseModel):
    """Free space on the disk below which the recorder records less.

    Attributes:
        warn_mib: Below this the recorder publishes an event [MiB].
        video_mib: Below this it records no video [MiB].
        states_mib: Below this it records no values that can be computed from the joints again [MiB].
    """

    model_config = PART_CONFIG
    warn_mib: Annotated[float, Field(ge=0)] = 2048
    video_mib: Annotated[float, Field(ge=0)] = 512
    states_mib: Annotated[float, Field(ge=0)] = 64


class Recorder(BaseModel):
    """Recordings.

    Attributes:
        folder: Folder of the recordings.
        views: Views recorded by default; each keeps the renderer busy during a recording. Absent: one view
            that shows the whole arm.
        flight: The flight recorder.
        split: Size and duration of a file.
        free: Limits of the free space.
    """

    model_config = PART_CONFIG
    folder: Path = Path("recordings")
    views: tuple[str, ...] | None = None
    flight: FlightRecorder = FlightRecorder()
    split: Split = Split()
    free: FreeSpace = FreeSpace()


class Renderer(BaseModel):
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

    model_config = PART_CONFIG
    views: tuple[str, ...] = ("front", "top", "left", "free")
    # Even numbers: H.264 halves the resolution of colour.
    size: tuple[Pixels, Pixels] = (1280, 720)
    fps: Annotated[float, Field(ge=1, le=120)] = 30
    anti_aliasing: Literal[0, 2, 4, 8] = 4
    shading: Literal["fast", "full"] = "fast"
    device: Annotated[int, Field(ge=0, le=63)] | None = None
    most_views: Annotated[int, Field(ge=0, le=256)] = 32
