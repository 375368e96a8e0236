"""How `robomesh probe` knows a kind of controller by what its port sends and answers."""

import socket
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from robomesh.errors import RobomeshError

LISTEN_S = 2.0
ANSWER_S = 2.0
MOST_BYTES = 1 << 16
LONGEST_SHOWN = 60


class ProbeError(RobomeshError):
    """The port cannot be probed."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """Result of a probe.

    Attributes:
        protocol: The site file's `protocol` that reads it; empty: unknown, or not one that robomesh reads.
        text: In a sentence.
        next: What to do with it.
        sent: What was sent, in words.
        received_bytes: Number of received bytes; None: a library received them.
    """

    protocol: str = ""
    text: str
    next: str = ""
    sent: str = "nothing"
    received_bytes: int | None = 0


@dataclass(frozen=True, kw_only=True)
class Asked:
    """A question that a kind's ports may be asked, if they send nothing unasked.

    Attributes:
        sent: The question in words.
        question: Its bytes.
        enough: Returns whether the answer is complete.
        meaning: Returns what the answer means, without `sent` and its number of bytes.
    """

    sent: str
    question: bytes
    enough: Callable[[bytes], bool]
    meaning: Callable[[bytes], Found]


@dataclass(frozen=True, kw_only=True)
class Probe:
    """How a kind is known.

    Attributes:
        scheme: `tcp`, `udp`, or another one.
        ports: Ports at which it is asked.
        listens: Ports at which `heard` looks; None: any.
        asks: The question, for tcp and udp.
        sends: The question, for the help: "the RTDE version to port 30004".
        knows: Returns whether what was heard is certainly of this kind, so that no more is awaited.
        heard: Returns what bytes mean that a port sent unasked; None: they are of another kind.
        examine: For another scheme: returns the result for an address that sends nothing unasked.
    """

    scheme: str = "tcp"
    ports: tuple[int, ...] = ()
    listens: tuple[int, ...] | None = ()
    asks: Asked | None = None
    sends: str = ""
    knows: Callable[[bytes], bool] = field(default=lambda heard: False)
    heard: Callable[[bytes], Found | None] = field(default=lambda heard: None)
    examine: Callable[[str], Found] | None = None


def listen(connection: socket.socket, seconds: float, enough: Callable[[bytes], bool]) -> bytes:
    """Return what arrives within a time, or until it is enough."""
    heard = b""
    ends_s = time.monotonic() + seconds
    while (left_s := ends_s - time.monotonic()) > 0 and len(heard) < MOST_BYTES and not enough(heard):
        connection.settimeout(left_s)
        try:
            chunk = connection.recv(MOST_BYTES)
        except TimeoutError:
            break
        if not chunk:
            break
        heard += chunk
    return heard


def ask(connection: socket.socket, asked: Asked) -> Found:
    """Ask, and return what the answer means."""
    connection.sendall(asked.question)
    heard = listen(connection, ANSWER_S, asked.enough)
    return replace(asked.meaning(heard), sent=asked.sent, received_bytes=len(heard))


def nothing_known(heard: bytes, what: str) -> Found:
    """Return that an answer is of no kind."""
    return Found(text=f"it {'answers something unknown' if heard else 'answers nothing'} to {what}")
