"""What every socket that units go over has in common."""

import socket


def configure(connected: socket.socket, *, send_buffer_bytes: int, unacknowledged_ms: int) -> None:
    """Units go out at once; a host that vanished is noticed in seconds.

    Args:
        send_buffer_bytes: Of the kernel's: what a peer that does not read is given at most.
        unacknowledged_ms: What its host has not acknowledged for this long breaks the connection.
    """
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, send_buffer_bytes)
    connected.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 2)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 1)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
    connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, unacknowledged_ms)
