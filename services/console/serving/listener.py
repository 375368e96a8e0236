"""The console's listening socket: limits connections per address, and keeps send buffers small."""

import contextlib
import errno
import socket
from collections import Counter
from collections.abc import Iterator
from typing import Any

from robomesh.errors import UnavailableError
from services.used_ports import in_use

# Send buffer of a connection: a second of state for a slow browser, not a minute.
_SEND_BUFFER = 128 * 1024
# The unsent part of it: newer samples cannot replace what is in this buffer.
_UNSENT = 16 * 1024
# A browser that acknowledges nothing for this long is disconnected.
_TAKES_WITHIN_MS = 60_000


class Listener(socket.socket):
    """A listening socket that drops connections above an address's limit, before a byte is read.

    Attributes:
        most: Maximum number of connections.
        most_of_one: Maximum number of connections from one address.
        most_in_turn: Connections that a turn of the event loop accepts.
    """

    most = 768
    most_of_one = 256
    most_in_turn = 8

    def __init__(self, *values: Any, **named: Any) -> None:
        super().__init__(*values, **named)
        self._open: Counter[str] = Counter()
        self._in_turn = 0

    def accept(self) -> tuple[socket.socket, Any]:
        """Return the next connection within the limits, like `socket.accept`.

        Raises:
            BlockingIOError: If there is none, or the next turn of the event loop is due.
        """
        self._in_turn += 1
        if self._in_turn > self.most_in_turn:
            self._in_turn = 0
            raise BlockingIOError(errno.EAGAIN, "more in the next turn")
        for _ in range(self.most):
            try:
                connection, peer = super().accept()
            except BlockingIOError:
                self._in_turn = 0
                raise
            address = str(peer[0])
            if self._open.total() < self.most and self._open[address] < self.most_of_one:
                self._open[address] += 1
                return _Counted.of(connection, self._open, address), peer
            connection.close()
        raise BlockingIOError(errno.EAGAIN, "a flood of connections")


class _Counted(socket.socket):
    """A connection that is counted until it is closed."""

    _counts: Counter[str] | None = None
    _address = ""

    @classmethod
    def of(cls, connection: socket.socket, counts: Counter[str], address: str) -> "_Counted":
        counted = cls(connection.family, connection.type, connection.proto, fileno=connection.detach())
        counted._counts, counted._address = counts, address
        return counted

    def close(self) -> None:
        super().close()
        counts, self._counts = self._counts, None
        if counts is not None:
            counts[self._address] -= 1
            if not counts[self._address]:
                del counts[self._address]


@contextlib.contextmanager
def listening(host: str, port: int) -> Iterator[socket.socket]:
    """Yield a listening socket with small send buffers.

    Raises:
        UnavailableError: If the address is in use, or is not this machine's.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = Listener(family, kind, protocol)
    except OSError as error:
        raise UnavailableError(f"the console cannot listen on {host}:{port}: {error.strerror}") from None
    with listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        if hasattr(socket, "TCP_NOTSENT_LOWAT"):
            listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, _UNSENT)
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _TAKES_WITHIN_MS)
        try:
            listener.bind(address)
        except OSError as error:
            remedy = "choose another address with [console] listen"
            if error.errno == errno.EADDRINUSE:
                raise in_use("the console", host, port, remedy) from None
            raise UnavailableError(
                f"the console cannot listen on {host}:{port}: {error.strerror}; {remedy}"
            ) from None
        yield listener
