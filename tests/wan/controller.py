"""A controller of the old protocol: 100 units a second; prints when each stop arrived [monotonic s].

`moving`: the arm swings without a command."""

import contextlib
import math
import socket
import sys
import threading
import time

_PERIOD_S = 0.01


def tell(client: socket.socket, moving: bool) -> None:
    """Send the arm's position while a client is connected."""
    next_s, count = time.monotonic(), 0
    with contextlib.suppress(OSError):
        while True:
            count += 1
            angle = 60.0 * math.sin(count * 0.01) if moving else 0.0
            client.sendall(
                f"2#ABSOLUTE.DEG*{angle:.2f};0.00;0.00;0.00;0.00&STATUS*idle;remote;homed@".encode()
            )
            next_s += _PERIOD_S
            time.sleep(max(next_s - time.monotonic(), 0.0))


def hear(client: socket.socket) -> None:
    """Read commands without executing them, and record stops."""
    rest = b""
    with contextlib.suppress(OSError):
        while data := client.recv(65536):
            at = time.monotonic()
            *units, rest = (rest + data).split(b"@")
            for unit in units:
                if b"stop" in unit:
                    print(at, flush=True)


def main() -> None:
    """Serve until killed."""
    server = socket.create_server((sys.argv[1], int(sys.argv[2])))
    while True:
        client, _ = server.accept()
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        threading.Thread(target=tell, args=(client, "moving" in sys.argv), daemon=True).start()
        threading.Thread(target=hear, args=(client,), daemon=True).start()


if __name__ == "__main__":
    main()
