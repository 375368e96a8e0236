"""Where the console listens: nobody has more connections than his share, and none holds much back."""

import contextlib
import errno
import socket
from collections import Counter
from collections.abc import Iterator
from typing import Any

from services.errors import ListenError

# What the system may hold back for a slow browser: a second of state, not a minute of it.
_SEND_BUFFER = 128 * 1024
# And of that what has not even left: what waits here cannot be replaced by something newer.
_UNSENT = 16 * 1024
# Who takes nothing of what was sent for so long is gone, whatever it had asked for.
_TAKES_WITHIN_MS = 60_000


class Listener(socket.socket):
    """A listening socket that drops what is beyond an address's share, before a byte is read.

    Attributes:
        most: Connections in all.
        most_of_one: Of one address.
    """

    most = 768
    most_of_one = 256

    def __init__(self, *values: Any, **named: Any) -> None:
        super().__init__(*values, **named)
        self._open: Counter[str] = Counter()

    def accept(self) -> tuple[socket.socket, Any]:
        """The next connection that may be; as `socket.accept` where there is none.

        Raises:
            BlockingIOError: If there is none.
        """
        for _ in range(self.most):
            connection, peer = super().accept()
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
    """A listening socket whose connections hold little back.

    Raises:
        ListenError: If the address is taken, or not ours.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = Listener(family, kind, protocol)
    except OSError as error:
        raise ListenError(f"the console cannot listen on {host}:{port}: {error.strerror}") from None
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
            raise ListenError(
                f"the console cannot listen on {host}:{port}: {error.strerror}; free it, or name another "
                "with [console] listen"
            ) from None
        yield listener
