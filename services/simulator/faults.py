"""Faults that a real controller shows, on purpose: NAME or NAME@SECONDS after the first client came.

freeze    bytes stop and nothing is read, the sockets stay open; 5 s in unless said
garbage   malformed units between the good ones; from the start unless said
"""

import itertools
from collections.abc import Iterator, Sequence

from services.simulator.errors import SimulatorError

_BEGIN_S = {"freeze": 5.0, "garbage": 0.0}

# A unit out of ten, each refused for a reason of its own, each taken as a good one by a careless reader.
_EVERY = 10
_GARBAGE = (
    b"3#ABSOLUTE.DEG*1.00;2.00;3.00@",
    b"1#ABSOLUTE.DEG*90.00;9O.00;90.00;90.00;90.00@",
    b"1#ABSOLUTE.DEG*nan;nan;nan;nan;nan@",
    b"1#ABSOLUTE.DEG*1e999;0.00;0.00;0.00;0.00@",
    b"1#99999999999*1.00@",
    b"1#ABSOLUTE.DEG*10.00;20.\xb00;30.00;40.00;50.00@",
    b"#@",
    b"@",
    b"1#ABSOLUTE.DEG*10.00;20.1#ABSOLUTE.DEG*10.00;20.00;30.00;40.00;50.00@",
    b"\x00\xff\xfe\x1b[2J@",
)


def parse_faults(texts: Sequence[str]) -> dict[str, float]:
    """When each fault begins [s].

    Raises:
        SimulatorError: If one is unknown.
    """
    faults = {}
    for text in texts:
        name, _, seconds = text.partition("@")
        try:
            faults[name] = float(seconds) if seconds else _BEGIN_S[name]
            if not (name in _BEGIN_S and faults[name] >= 0.0):
                raise ValueError
        except (KeyError, ValueError):
            raise SimulatorError(
                f"fault {text!r} is unknown: {' or '.join(_BEGIN_S)}, with @SECONDS for when it begins"
            ) from None
    return faults


def garbage() -> Iterator[bytes]:
    """What goes before each good unit: mostly nothing."""
    for number in itertools.count():
        index, rest = divmod(number, _EVERY)
        yield b"" if rest else _GARBAGE[index % len(_GARBAGE)]
