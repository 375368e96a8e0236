"""A wide-area link in user space: packets between two TUN devices, delayed, lost, throttled or cut.

Each link is a separate process. Its first argument is JSON: two ends, each a namespace (a file descriptor
that it inherits), a device's name and an address. Each line on its standard input changes what the link does
and is answered with what it did so far; the link ends with its input, so it never outlives the process that
started it.

Each direction by itself: `delay_ms`; `jitter_ms` (up to so much more, in order); `loss` (a share of 1);
`rate_bps` (0: no limit) behind a queue of `queue_bytes`, and what finds that full is lost, as in a router;
`cut` (what is on its way is lost too).
"""

import ctypes
import fcntl
import json
import os
import random
import select
import struct
import subprocess
import sys
import time
from collections import deque
from contextlib import suppress
from dataclasses import asdict, dataclass, field, fields
from typing import Any

_SETIFF = 0x400454CA
_TUN_WITHOUT_INFO = 0x0001 | 0x1000
_MTU = 1500
# Read in one go: the other direction must have its turn too.
_AT_ONCE = 64
# No link of the tests holds more: 100 Mbit/s for a second and a half.
_MOST_WAITING_BYTES = 20_000_000
_C = ctypes.CDLL(None, use_errno=True)


@dataclass
class Way:
    """One direction: settings and counters."""

    delay_ms: float = 0.0
    jitter_ms: float = 0.0
    loss: float = 0.0
    rate_bps: float = 0.0
    queue_bytes: int = 64_000
    cut: bool = False
    packets: int = 0
    bytes: int = 0
    lost: int = 0
    overflowed: int = 0


@dataclass
class Direction:
    """Queue of packets from one device to another, in order."""

    source: int
    sink: int
    way: Way
    waiting: deque[tuple[float, bytes]] = field(default_factory=deque)
    waiting_bytes: int = 0
    # When the last packet has left the queue, and when it arrives.
    free_at: float = 0.0
    last_due: float = 0.0

    def take(self) -> None:
        """Read packets, and timestamp them."""
        way = self.way
        for _ in range(_AT_ONCE):
            try:
                packet = os.read(self.source, _MTU + 64)
            except BlockingIOError:
                return
            if packet[0] >> 4 != 4:
                continue  # IPv6's own announcements
            now, size = time.monotonic(), len(packet)
            if way.cut or random.random() < way.loss:
                way.lost += 1
                continue
            leaves = now
            if way.rate_bps:
                queued = max(self.free_at - now, 0.0) * way.rate_bps / 8
                if queued + size > way.queue_bytes:
                    way.overflowed += 1
                    continue
                leaves = self.free_at = max(self.free_at, now) + size * 8 / way.rate_bps
            if self.waiting_bytes + size > _MOST_WAITING_BYTES:
                way.overflowed += 1
                continue
            due = leaves + (way.delay_ms + random.random() * way.jitter_ms) * 1e-3
            self.last_due = due = max(due, self.last_due)
            self.waiting.append((due, packet))
            self.waiting_bytes += size

    def give(self) -> None:
        """Send the packets that are due."""
        while self.waiting and self.waiting[0][0] <= time.monotonic():
            _, packet = self.waiting.popleft()
            self.waiting_bytes -= len(packet)
            with suppress(OSError):  # the far end is going down
                os.write(self.sink, packet)
                self.way.packets += 1
                self.way.bytes += len(packet)

    def change(self, values: dict[str, Any]) -> None:
        """Change the settings from now on."""
        for name, value in values.items():
            setattr(self.way, name, value)
        if self.way.cut:
            self.way.lost += len(self.waiting)
            self.waiting.clear()
            self.waiting_bytes = 0
            self.free_at = self.last_due = 0.0


def device(netns: int, name: str, address: str) -> int:
    """Return a TUN device in a namespace, up and with an address."""
    if _C.setns(netns, 0):
        raise OSError(ctypes.get_errno(), "cannot enter the namespace")
    tun = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tun, _SETIFF, struct.pack("16sH22x", name.encode(), _TUN_WITHOUT_INFO))
    for words in (f"addr add {address} dev {name}", f"link set {name} mtu {_MTU} up"):
        subprocess.run(["ip", *words.split()], check=True)
    return tun


def main() -> None:
    """Carry packets until standard input ends."""
    ends = json.loads(sys.argv[1])
    near, far = (device(**end) for end in ends)
    ways = {"forth": Direction(near, far, Way()), "back": Direction(far, near, Way())}
    with suppress(PermissionError):
        os.nice(-15)  # late packets would be this program's doing, not the link's
    print("ready", flush=True)
    commands = b""
    while True:
        due = min((way.waiting[0][0] for way in ways.values() if way.waiting), default=None)
        timeout = None if due is None else max(due - time.monotonic(), 0.0)
        # Of all that waits, select alone has a time-out finer than a millisecond.
        readable, _, _ = select.select([near, far, sys.stdin], [], [], timeout)
        for way in ways.values():
            if way.source in readable:
                way.take()
            way.give()
        if sys.stdin in readable:
            data = os.read(sys.stdin.fileno(), 65536)
            if not data:
                return
            *lines, commands = (commands + data).split(b"\n")
            for line in lines:
                for name, values in json.loads(line).items():
                    ways[name].change(values)
                print(json.dumps({name: asdict(each.way) for name, each in ways.items()}), flush=True)


SETTINGS = frozenset(each.name for each in fields(Way)[:6])

if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        main()
