"""Options of every socket that carries units."""

import socket


def configure(connected: socket.socket, *, send_buffer_bytes: int, unacknowledged_ms: int) -> None:
    """Configure a socket to send units without delay, and to detect a vanished host within seconds.

    Args:
        send_buffer_bytes: Size of the kernel's send buffer: limits what a peer that does not read can get.
        unacknowledged_ms: Time after which unacknowledged data break the connection.
    """
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, send_buffer_bytes)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 2)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, unacknowledged_ms)
