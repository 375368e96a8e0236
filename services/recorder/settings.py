"""The site file's `[recorder]`, and the settings of the service, which add what it knows of the site."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from robomesh.contract.quotas import DEFAULT_QUOTAS, Quotas
from robomesh.schemas.robomesh_pb2 import Event
from robots.schema.toml_table import TomlTable

MIB = 1 << 20


class Flight(TomlTable):
    """The last minutes of every robot, saved after an event.

    Attributes:
        minutes: Time that is kept [min]; 0: no flight recorder.
        severity: Least severity of an event that saves it.
        after_s: Time after the event that is added [s].
    """

    minutes: Annotated[float, Field(ge=0, le=120)] = 5
    severity: Literal["warning", "error", "critical"] = "error"
    after_s: Annotated[float, Field(ge=0, le=600)] = 30

    @property
    def least_severity(self) -> Event.Severity:
        """The severity as events have it."""
        found: Event.Severity = getattr(Event.Severity, self.severity.upper())
        return found


class Split(TomlTable):
    """Limits at which a recording continues in a new file.

    Attributes:
        mib: Size of a file [MiB].
        minutes: Duration of a file [min].
    """

    mib: Annotated[float, Field(ge=1, le=65536)] = 1024
    minutes: Annotated[float, Field(ge=0.1, le=1440)] = 60


class FreeSpace(TomlTable):
    """Free space on the disk below which the recorder records less.

    Attributes:
        warn_mib: Below this the recorder publishes an event [MiB].
        video_mib: Below this it records no video [MiB].
        states_mib: Below this it records no values that can be computed from the joints again [MiB].
    """

    warn_mib: Annotated[float, Field(ge=0)] = 2048
    video_mib: Annotated[float, Field(ge=0)] = 512
    states_mib: Annotated[float, Field(ge=0)] = 64


class Recorder(TomlTable):
    """Recordings.

    Attributes:
        folder: Folder of the recordings.
        views: Views recorded by default; each keeps the renderer busy during a recording. Absent: one view
            that shows the whole arm.
        flight: The flight recorder.
        split: Size and duration of a file.
        free: Limits of the free space.
    """

    folder: Path = Path("recordings")
    views: tuple[str, ...] | None = None
    flight: Flight = Flight()
    split: Split = Split()
    free: FreeSpace = FreeSpace()


class Settings(Recorder):
    """Settings of a site's recorder.

    Attributes:
        robots: Robots that can be recorded from the start; others of the site once their gateway is online.
        views: Views recorded by default, after the site file's default was applied.
        quotas: Quotas of each client that reads recordings.
        site_file: Text of the site file, attached to each recording; empty if there is none.
    """

    site: str
    robots: tuple[str, ...]
    views: tuple[str, ...] = ()
    quotas: Quotas = DEFAULT_QUOTAS
    site_file: str = ""
