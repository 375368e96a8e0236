"""Publishers' times on a recording's time axis.

A message has a receive time on the recorder's clock and a source time on its publisher's clock. Nothing shows
which clock is right, but on one machine, or with synchronised clocks, they agree. If they do not agree, the
source times keep their spacing and begin at the first receive time.
"""

from typing import Protocol

# No message takes longer: a connection without traffic for 2 s is closed.
_MOST_APART_NS = 10_000_000_000


class Recorded(Protocol):
    """Times and sequence number of a recorded message."""

    @property
    def topic(self) -> str:
        """Topic of the channel."""
        ...

    @property
    def received_ns(self) -> int:
        """Receive time on the recorder's clock, ns since the Unix epoch."""
        ...

    @property
    def source_ns(self) -> int:
        """Source time on the publisher's clock, ns since the Unix epoch."""
        ...

    @property
    def sequence(self) -> int:
        """Sequence number of the publisher."""
        ...


class PublisherTimes:
    """Source times of messages on the time axis; call `of` in the order of the receive times."""

    def __init__(self) -> None:
        self._apart_ns: dict[str, int] = {}
        self._newest_ns: dict[str, int] = {}

    def of(self, message: Recorded) -> int:
        """Return a message's source time on the recording's time axis [ns since the Unix epoch].

        Returns the receive time if the source time is missing or not newer than the last one (a repeated
        picture of a silent robot).
        """
        topic, source_ns = message.topic, message.source_ns
        lag_ns = message.received_ns - source_ns
        apart_ns = self._apart_ns.get(topic, 0)
        another_clock = abs(lag_ns - apart_ns) > _MOST_APART_NS
        if source_ns <= 0 or (not another_clock and source_ns <= self._newest_ns.get(topic, 0)):
            return message.received_ns
        if another_clock:
            apart_ns = self._apart_ns[topic] = 0 if abs(lag_ns) <= _MOST_APART_NS else lag_ns
        self._newest_ns[topic] = source_ns
        return source_ns + apart_ns
