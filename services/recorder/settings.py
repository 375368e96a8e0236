"""Settings of the recorder service."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robomesh.contract.quotas import DEFAULT_QUOTAS, Quotas
from robomesh.schemas.robomesh_pb2 import Event

MIB = 1 << 20


@dataclass(frozen=True, kw_only=True)
class Flight:
    """Settings of the flight recorder.

    Attributes:
        minutes: Length of the ring.
        severity: Lowest severity of an event that causes a save.
        after_s: Time that a save continues after its last cause.
    """

    minutes: float = 5.0
    severity: Event.Severity = Event.Severity.ERROR
    after_s: float = 30.0


@dataclass(frozen=True, kw_only=True)
class Split:
    """Size and length at which a capture continues in another file."""

    mib: float = 1024.0
    minutes: float = 60.0


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Thresholds of free space [bytes].

    Attributes:
        warn: Below it the recorder publishes a warning.
        no_video: Below it video is not recorded.
        states_only: Below it frames and kinematics are not recorded either.
    """

    warn: int = 2048 * MIB
    no_video: int = 512 * MIB
    states_only: int = 64 * MIB


def flight_of(values: Mapping[str, Any]) -> Flight | None:
    """Return the flight recorder of a site file's values, or None if it is switched off."""
    if not values["minutes"]:
        return None
    severity: Event.Severity = getattr(Event.Severity, values["severity"].upper())
    return Flight(minutes=values["minutes"], severity=severity, after_s=values["after_s"])


def marks_of(values: Mapping[str, float]) -> Marks:
    """Return the thresholds of a site file's values."""
    return Marks(
        warn=round(values["warn_mib"] * MIB),
        no_video=round(values["video_mib"] * MIB),
        states_only=round(values["states_mib"] * MIB),
    )


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings of a site's recorder.

    Attributes:
        robots: Robots that can be recorded from the start; others of the site once their gateway is online.
        views: Views that a capture records as video, unless its request names others.
        flight: Settings of the flight recorder, or None for no flight recorder.
        quotas: Quotas of each client that reads recordings.
        site_file: Text of the site file, attached to each recording; empty if there is none.
    """

    site: str
    robots: tuple[str, ...]
    folder: Path
    views: tuple[str, ...] = ("front",)
    flight: Flight | None = None
    split: Split = Split()
    marks: Marks = Marks()
    quotas: Quotas = DEFAULT_QUOTAS
    site_file: str = ""
