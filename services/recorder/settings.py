"""What a recorder is told."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robomesh.quotas import DEFAULT_QUOTAS, Quotas
from robomesh.schemas.robomesh_pb2 import Event

MIB = 1 << 20


@dataclass(frozen=True, kw_only=True)
class Flight:
    """The flight recorder.

    Attributes:
        minutes: How much it always keeps.
        severity: Of an event that has it saved.
        after_s: How long it goes on after the last such event.
    """

    minutes: float = 5.0
    severity: Event.Severity = Event.Severity.ERROR
    after_s: float = 30.0


@dataclass(frozen=True, kw_only=True)
class Split:
    """When a capture goes on in a next file."""

    mib: float = 1024.0
    minutes: float = 60.0


@dataclass(frozen=True, kw_only=True)
class Marks:
    """Free space below which something happens [bytes].

    Attributes:
        warn: It is told.
        no_video: Video is recorded no more.
        states_only: What follows from the joints is recorded no more either.
    """

    warn: int = 2048 * MIB
    no_video: int = 512 * MIB
    states_only: int = 64 * MIB


def flight_of(values: Mapping[str, Any]) -> Flight | None:
    """The flight recorder of a site file's values; None: it has none."""
    if not values["minutes"]:
        return None
    severity: Event.Severity = getattr(Event.Severity, values["severity"].upper())
    return Flight(minutes=values["minutes"], severity=severity, after_s=values["after_s"])


def marks_of(values: Mapping[str, float]) -> Marks:
    """The marks of a site file's values."""
    return Marks(
        warn=round(values["warn_mib"] * MIB),
        no_video=round(values["video_mib"] * MIB),
        states_only=round(values["states_mib"] * MIB),
    )


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Whose captures go where.

    Attributes:
        robots: Those that can be recorded from the start; others of the site once their gateway is there.
        views: Those whose video a capture holds, unless its request names others.
        flight: None: no flight recorder.
        quotas: Of each asker of recordings.
        site_file: The site file's text, which goes into each recording; empty: there is none.
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
