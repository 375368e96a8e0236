"""The faults that there are, in words: for the simulator, the command line, its errors and docs/faults.md."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

COPIES = {"flood": 50, "deluge": 1000}
LEAP = 10.0  # degrees or mm


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault that there is.

    Attributes:
        what: It does, in words.
        begin_s: When it begins on the command line, unless said.
        length_s: How long it lasts, unless said.
    """

    what: str
    begin_s: float = 0.0
    length_s: float = math.inf


FAULTS: Mapping[str, Fault] = MappingProxyType(
    {
        "freeze": Fault(what="bytes stop and nothing is read, the sockets stay open", begin_s=5.0),
        "garbage": Fault(what="malformed units between the good ones"),
        "split": Fault(what="units come in pieces of a few bytes, with pauses between them"),
        "flood": Fault(what=f"every unit comes {COPIES['flood']} times"),
        "deluge": Fault(what=f"every unit comes {COPIES['deluge']} times: more than any link is for"),
        "drop": Fault(what="all connections are closed, each second again"),
        "jump": Fault(what=f"the first joint leaps by {LEAP:g}, each second, and the status says nothing"),
        "local": Fault(what="local mode: told so, and commands are refused, but for stop"),
        "fault": Fault(what="stops with a fault: told so, until it is reset"),
        "deaf": Fault(what="ignores stop"),
        "mute": Fault(what="tells its status no more, but its positions"),
        "joints": Fault(what="tells one joint more than it has"),
        "restart": Fault(what="closes all connections and comes back not homed", length_s=1.5),
        "refuse": Fault(what="closes all connections and lets nobody in: too many clients"),
        "burst": Fault(what="holds its units back for 2 s, then sends them at once, again and again"),
        "bare": Fault(what="tells its positions, nothing else"),
    }
)
