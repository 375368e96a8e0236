"""Publishers' times on a recording's time axis.

A message has the time when it was received, on the recorder's clock, and when it was so, on its publisher's.
Which of both clocks is right cannot be known, but on one machine, or where clocks are kept, they agree. Where
they do not, the publisher's times keep their spacing and begin at the first receipt.
"""

from typing import Protocol

# Nothing waits longer on its way: a connection that carries nothing for 2 s is given up.
_MOST_APART_NS = 10_000_000_000


class Recorded(Protocol):
    """When a recorded message was so, and its number."""

    @property
    def topic(self) -> str:
        """The channel's topic."""
        ...

    @property
    def received_ns(self) -> int:
        """When the recorder received it, by its clock, ns since the Unix epoch."""
        ...

    @property
    def source_ns(self) -> int:
        """When it was so, by its publisher's clock, ns since the Unix epoch."""
        ...

    @property
    def sequence(self) -> int:
        """Its publisher's number of it."""
        ...


class PublisherTimes:
    """Times of messages by their publishers' clocks; to be asked in the order of their receipt."""

    def __init__(self) -> None:
        self._apart_ns: dict[str, int] = {}
        self._newest_ns: dict[str, int] = {}

    def of(self, message: Recorded) -> int:
        """Return when a message was so, on the recording's time axis [ns since the Unix epoch].

        What is told again with an old time (a picture of a robot that is silent) has the time of its receipt,
        and so has what its publisher does not date.
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
