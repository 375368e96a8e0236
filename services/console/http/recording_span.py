"""The part of a recording that a request over HTTP names."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from robomesh import reason_codes as codes
from robomesh.schemas import robomesh_pb2 as schema
from services.console.common.errors import RefusedRequest


class Span(NamedTuple):
    """A part of a recording, by receive times [ns since the Unix epoch], both included; None: its ends.

    `begin_s` and `end_s` are the same, since the recording's start. `suffix` belongs to the name of an
    exported file.
    """

    start_ns: int | None = None
    end_ns: int | None = None
    suffix: str = ""
    begin_s: float = 0.0
    end_s: float | None = None

    def length_s(self, info: schema.Recording) -> float:
        """Return its length [s]."""
        end_s = info.duration.ToNanoseconds() * 1e-9 if self.end_s is None else self.end_s
        return end_s - self.begin_s


def span_of(info: schema.Recording, values: Mapping[str, str]) -> Span:
    """Return the part between `from` and `to`, seconds since the recording's start.

    Raises:
        RefusedRequest: If they are no times of the recording.
    """
    if not values.get("from") and not values.get("to"):
        return Span()
    first, last_s = info.start.ToNanoseconds(), info.duration.ToNanoseconds() * 1e-9
    try:
        begin_s, end_s = float(values.get("from") or 0.0), float(values.get("to") or last_s)
    except ValueError:
        begin_s = end_s = math.nan
    # A little after the end: callers round.
    if not 0.0 <= begin_s <= end_s or begin_s > last_s:
        raise RefusedRequest(400, codes.RECORDING_SPAN(file=info.file, seconds=last_s))
    end_s = min(end_s, last_s)
    end_ns = first + round(end_s * 1e9) if end_s < last_s else first + info.duration.ToNanoseconds()
    return Span(first + round(begin_s * 1e9), end_ns, f"_{begin_s:g}-{end_s:g}s", begin_s, end_s)
