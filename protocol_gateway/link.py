"""The link to one controller: keeps a connection, tells its state in words, hands over every event at once.

    DOWN --connected--> SILENT --unit--> UP
    UP --no unit for stale_after_s--> SILENT --none for reconnect_after_s--> DOWN
    any --connection lost--> DOWN --after a pause, 0.2 s growing to 5 s--> connect again

Data is dated once, when its last byte was read from the socket, and never again.
"""

import asyncio
import logging
import random
import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum

from protocol_gateway.driver import (
    ControllerEvent,
    Driver,
    MalformedReceived,
    Refused,
    UnknownReceived,
)
from protocol_gateway.errors import LinkCloggedError, LinkDownError

logger = logging.getLogger(__name__)

# A unit is some hundred bytes. A small send buffer makes a controller that does not read an
# error at once instead of kilobytes of commands that it would obey late.
_SEND_BUFFER_BYTES = 4096
_FIRST_PAUSE_S = 0.2
_LONGEST_PAUSE_S = 5.0


class LinkState(Enum):
    """State of the link, as in `robomesh.ControllerState.Link`."""

    DOWN = "down"
    UP = "up"
    SILENT = "silent"


@dataclass(frozen=True, kw_only=True)
class LinkSettings:
    """Where the controller is, and how patient the link.

    Attributes:
        stale_after_s: Without a unit for this long the link is SILENT.
        reconnect_after_s: Without a unit for this long the connection is given up and made anew.
        connect_timeout_s: For one attempt to connect.
    """

    host: str
    port: int
    stale_after_s: float = 1.0
    reconnect_after_s: float = 4.0
    connect_timeout_s: float = 3.0


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """State of the link and, for people, why."""

    state: LinkState
    text: str


@dataclass(frozen=True, slots=True)
class Received:
    """When an event's last byte was read from the socket.

    Attributes:
        monotonic_s: On the gateway's monotonic clock: for ages.
        wall_ns: On the gateway's wall clock, ns since the Unix epoch: the stamp of what is published.
    """

    monotonic_s: float
    wall_ns: int


@dataclass(frozen=True, slots=True)
class LinkCounters:
    """Counts since the gateway's start, as in `robomesh.LinkCounters`."""

    units_received: int = 0
    units_malformed: int = 0
    units_sent: int = 0
    bytes_received: int = 0
    bytes_sent: int = 0
    records_unknown: int = 0
    connections: int = 0
    refusals: int = 0


class ControllerLink:
    """A link to one controller.

    `on_event` and `on_status` are called on the event loop, straight from the socket's callback:
    no queue, no task switch. They must return soon, and an exception of theirs ends `run`.
    """

    def __init__(
        self,
        settings: LinkSettings,
        driver: Driver,
        *,
        on_event: Callable[[ControllerEvent, Received], None],
        on_status: Callable[[LinkStatus], None] = lambda status: None,
        monotonic_s: Callable[[], float] = time.monotonic,
        wall_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        raise NotImplementedError

    @property
    def status(self) -> LinkStatus:
        """State of the link, in words too."""
        raise NotImplementedError

    @property
    def counters(self) -> LinkCounters:
        """Counts so far."""
        raise NotImplementedError

    @property
    def last_received(self) -> Received | None:
        """When the last well-formed unit came; None: none yet."""
        raise NotImplementedError

    @property
    def rate_hz(self) -> float:
        """Units a second, over the last second."""
        raise NotImplementedError

    async def run(self) -> None:
        """Keep the link until cancelled; the connection is closed then."""
        raise NotImplementedError

    def send(self, data: bytes) -> None:
        """Write a whole unit to the socket, now. Nothing is ever queued, so nothing goes before it.

        On return the unit is in the hands of the operating system, whole. After an error it is not,
        and it will not be done later.

        Raises:
            LinkDownError: If there is no connection.
            LinkCloggedError: If the socket does not take it whole; the connection is given up then.
        """
        raise NotImplementedError
