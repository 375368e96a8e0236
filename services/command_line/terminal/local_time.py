"""Times of messages in this machine's time zone. A publisher may send any time."""

from datetime import datetime

from google.protobuf.timestamp_pb2 import Timestamp

# Days from the ends of the calendar, so that every time zone can show them.
_FIRST_S, _LAST_S = -62_135_400_000.0, 253_402_200_000.0


def local_time(at: Timestamp | float) -> datetime:
    """Return a time, or seconds since the Unix epoch, as local time, within the calendar."""
    at_s = at.ToNanoseconds() * 1e-9 if isinstance(at, Timestamp) else at
    within_s = min(at_s if at_s > _FIRST_S else _FIRST_S, _LAST_S)  # not a number: the first day
    return datetime.fromtimestamp(within_s).astimezone()


def time_text(at: Timestamp | float | datetime, timespec: str = "seconds") -> str:
    """Return a time for people, in this machine's zone: "2026-11-29 14:02:11+08:00".

    Args:
        at: Seconds since the Unix epoch, if it is a number.
        timespec: The last part, as in `datetime.isoformat`.
    """
    local = at.astimezone() if isinstance(at, datetime) else local_time(at)
    return local.isoformat(" ", timespec)
