"""Table of the faults, for the simulator, the command line, its errors and docs/faults.md."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from types import MappingProxyType

COPIES = {"flood": 50, "deluge": 1000}
LEAP = 10.0  # degrees or mm
_CORRUPTED = 1e5  # degrees or mm
_CORRUPTED_EACH_S, _CORRUPTED_FOR_S = 4.0, 0.05


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault.

    Attributes:
        effect: Description of its effect.
        begin_s: Default begin of a fault from the command line [s].
        length_s: Default length [s].
    """

    effect: str
    begin_s: float = 0.0
    length_s: float = math.inf


FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "freeze": Fault(effect="neither sends nor reads, the sockets stay open", begin_s=5.0),
        "garbage": Fault(effect="malformed units between the valid ones"),
        "split": Fault(effect="units arrive in pieces of a few bytes, with pauses between them"),
        "flood": Fault(effect=f"every unit is sent {COPIES['flood']} times"),
        "deluge": Fault(effect=f"every unit is sent {COPIES['deluge']} times, more than any link can carry"),
        "drop": Fault(effect="all connections are closed, each second again"),
        "jump": Fault(effect=f"the first joint jumps by {LEAP:g} each second, with unchanged status"),
        "corrupt": Fault(
            effect=f"the first joint is {_CORRUPTED:g} off for a moment, each {_CORRUPTED_EACH_S:g} s"
        ),
        "local": Fault(effect="reports local mode and refuses commands except stop"),
        "fault": Fault(effect="stops and reports a fault until it is reset"),
        "deaf": Fault(effect="ignores stop"),
        "mute": Fault(effect="sends positions but no status"),
        "joints": Fault(effect="reports one joint too many"),
        "restart": Fault(effect="closes all connections and restarts not homed", length_s=1.5),
        "refuse": Fault(effect="closes all connections and refuses new ones: too many clients"),
        "burst": Fault(effect="holds its units back for 2 s, then sends them together, again and again"),
        "bare": Fault(effect="sends positions only"),
        "busy": Fault(effect="answers every second question with busy"),
        "loss": Fault(effect="does not answer every third question"),
    }
)


def displacement(active: Collection[str], now_s: float) -> float:
    """Return by how many degrees or mm the first joint is reported too high."""
    if "corrupt" in active and now_s % _CORRUPTED_EACH_S < _CORRUPTED_FOR_S:
        return _CORRUPTED
    return LEAP if "jump" in active and int(now_s) % 2 else 0.0


UNIT_FAULTS = tuple(name for name in FAULTS if name not in ("busy", "loss"))
"""Faults of a controller with the unit protocol: it is not asked for its state."""
