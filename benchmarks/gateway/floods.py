"""Floods that one client of the mesh can send, for `stops_beside`.

Each is an endless loop over plain Zenoh sessions, written from Zenoh's own documentation, because the library
of robomesh limits its clients. On a mesh with keys a flood has the certificate of its role.
"""

import itertools
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import zenoh

from robomesh.contract.topics import Role

ROBOT = "robomesh/bench/arm"
MOST_TOKENS = 10_000

Connect = Callable[[], zenoh.Session]


@dataclass(frozen=True)
class Flood:
    """One kind of flood.

    Attributes:
        send: Sends the flood's next requests for ever, and yields after each.
        role: Role of the client's certificate.
        per_s: Rate of one source; 0: as fast as Zenoh takes it.
        keyless: Only for a mesh without keys.
    """

    send: Callable[[Connect, str], Iterator[None]]
    role: Role = Role.MONITOR
    per_s: float = 0.0
    keyless: bool = False


def run(kind: Flood, connect: Connect, name: str, count: Any) -> None:
    """Send a flood until the process ends; `count[0]` counts its requests."""
    began = time.monotonic()
    for sent, _ in enumerate(kind.send(connect, name), 1):
        count[0] += 1
        if kind.per_s and (early_s := began + sent / kind.per_s - time.monotonic()) > 0:
            time.sleep(early_s)


def _gets(key: str, payload: bytes = b"{}") -> Callable[[Connect, str], Iterator[None]]:
    """Return a flood of requests without waiting for an answer; `{name}` is the client's name."""

    def send(connect: Connect, name: str) -> Iterator[None]:
        session = connect()
        while True:
            session.get(key.format(name=name), payload=payload, timeout=10.0)
            yield

    return send


def _names(connect: Connect, name: str) -> Iterator[None]:
    session = connect()
    for number in itertools.count():
        session.get(f"{ROBOT}/command/{name}-{number % 100}", payload=b"{}", timeout=10.0)
        yield


def _stops_of_many(connect: Connect, name: str) -> Iterator[None]:
    session = connect()
    for number in itertools.count():
        payload = json.dumps({"by": f"{name} {number}", "reason": "flood"}).encode()
        session.get(f"{ROBOT}/stop", payload=payload, timeout=10.0)
        yield


def _tokens(connect: Connect, name: str) -> Iterator[None]:
    """Declare tokens of presence and undeclare the oldest."""
    session = connect()
    held: list[zenoh.LivelinessToken] = []
    for number in itertools.count():
        held.append(session.liveliness().declare_token(f"{ROBOT}/alive/operator/{name}.{number:016x}"))
        if len(held) > MOST_TOKENS:
            held.pop(0).undeclare()
        yield


def _declarations(connect: Connect, name: str) -> Iterator[None]:
    """Subscribe to everything and unsubscribe, so that each publisher's matching changes."""
    session = connect()
    while True:
        session.declare_subscriber("robomesh/**", lambda sample: None).undeclare()
        yield


def _connections(connect: Connect, name: str) -> Iterator[None]:
    while True:
        connect().close()
        yield


def _puts(connect: Connect, name: str) -> Iterator[None]:
    session = connect()
    payload = bytes(200)
    while True:
        session.put(f"{ROBOT}/joints", payload, priority=zenoh.Priority.REAL_TIME)
        yield


FLOODS = {
    "commands": Flood(_gets(ROBOT + "/command/{name}"), Role.OPERATOR),
    "names": Flood(_names, Role.OPERATOR, keyless=True),
    "stops": Flood(_stops_of_many, per_s=400.0),
    "every stop": Flood(_gets("robomesh/*/*/stop"), per_s=400.0),
    "long stops": Flood(_gets(ROBOT + "/stop", json.dumps({"reason": "x" * 60_000}).encode()), per_s=100.0),
    "tokens": Flood(_tokens, Role.OPERATOR),
    "leases": Flood(_gets(ROBOT + "/lease/request/{name}", b'{"action": "ASK"}'), Role.OPERATOR),
    "keep-alives": Flood(_gets(ROBOT + "/jog/{name}"), Role.OPERATOR),
    "last values": Flood(_gets("robomesh/**", b"")),
    "audit": Flood(_gets(ROBOT + "/audit/find")),
    "declarations": Flood(_declarations),
    "connections": Flood(_connections),
    "puts": Flood(_puts),
}
