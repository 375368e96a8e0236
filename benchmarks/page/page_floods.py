"""A page's stops while other pages flood the console: idle, during two CPU burners, and during each flood.

    ./dev run python -m benchmarks page_floods [--presses 20] [--rounds 3] [--kinds watches,pings] [--json]

A real router, a gateway of two robots, their controllers and a console with accounts are separate processes.
One operator's page presses stop of both robots in turn, at a fixed pace that waits for no answer. One
and then two read-only accounts flood the console, each from a separate process that writes as fast as
the console reads, and connects again whenever the console closes its connection. The loads take turns, so
that other load on the machine affects all of them.

`wire`: from the press to the next stop unit at the controller; `answer`: to the answer at the page. A press
without an answer after 10 s is missing. Target: p95 at most three times the p95 with the CPU burners, no
press without an answer.
"""

import asyncio
import contextlib
import json
import math
import multiprocessing
import socket
import statistics
import threading
import time
from collections.abc import Iterator
from itertools import count
from typing import Annotated, Any
from urllib.request import Request, urlopen

from typer import Option
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus
from websockets.frames import Frame, Opcode

from benchmarks.gateway.stops_beside import MOST_STOPS, ROBOTS, recording_controllers, summary
from benchmarks.harness.burners import burn
from benchmarks.harness.processes import piped, process
from benchmarks.harness.program import chosen
from benchmarks.harness.sites import Site, running_site
from robomesh.schemas.robomesh_pb2 import FromPage, ToPage
from services.console.accounts import passwords
from services.console.accounts.auth_service import change_account
from services.console.accounts.file import AccountRole
from services.console.app import PAGE

PASSWORD = "three arms in a hall"
OPERATOR, FLOODERS = "li", ("eve", "mallory")
# The gateway sends one unit for presses within 0.1 s, so a robot is pressed every 0.25 s.
PRESS_EACH_S, ANSWER_WITHIN_S, SETTLE_S = 0.125, 10.0, 1.0
BLOCK = 64 * 1024


def measure(
    presses: Annotated[int, Option(help="of each robot, load and round")] = 20,
    rounds: Annotated[int, Option(help="how often the loads take turns")] = 3,
    kinds: Annotated[str, Option(help="floods, separated by commas; none: all")] = "",
) -> dict[str, Any]:
    """Press stop during each load."""
    floods = chosen("--kinds", kinds, KINDS) or [*KINDS]
    loads = [("idle", 0), ("burners", 2), *((kind, sources) for kind in floods for sources in (1, 2))]
    found: dict[str, list[list[tuple[float, float]]]] = {}
    opened = multiprocessing.RawArray("q", len(FLOODERS))
    connections: dict[str, int] = {}
    with site() as (address, arrivals), presser(address) as pipe:
        cookies = [sign_in(address, name) for name in FLOODERS]
        for _ in range(rounds):
            for load, sources in loads:
                name = load if load in ("idle", "burners") else f"{load} x{sources}"
                before = sum(opened)
                with contextlib.ExitStack() as stack:
                    for index in range(sources):
                        flooding = (flood, address, cookies[index], load, index, opened)
                        stack.enter_context(process(*((burn,) if load == "burners" else flooding)))
                    while load in KINDS and sum(opened) < before + sources:
                        time.sleep(0.01)
                    time.sleep(SETTLE_S)
                    found.setdefault(name, []).append(press(pipe, presses, arrivals))
                connections[name] = connections.get(name, 0) + sum(opened) - before
                time.sleep(SETTLE_S)
    rows = {name: summary([pair for each in turns for pair in each]) for name, turns in found.items()}
    for name, row in rows.items():
        p95s = [summary(each)["answer"]["p95"] for each in found[name]]
        row["missing"] = sum(answer != answer for turns in found[name] for _, answer in turns)
        row["p95_of_rounds"] = [min(p95s), max(p95s)]
        row["median_p95"] = statistics.median(p95s)
        row["connections"] = connections[name]
    burners = rows["burners"]
    ratios = {
        name: max(row[what]["p95"] / burners[what]["p95"] for what in ("wire", "answer"))
        for name, row in rows.items()
    }
    return {"times_ms": rows, "to_burners_p95": ratios}


# -------------------------------------------------------------------------- the site


@contextlib.contextmanager
def site() -> Iterator[tuple[str, Any]]:
    """Run a site and yield the console's HOST:PORT and the arrivals of stops at the controllers [ns]."""

    def prepare(site: Site) -> None:
        hashed = passwords.hash_password(PASSWORD)
        roles = {OPERATOR: AccountRole.OPERATOR} | dict.fromkeys(FLOODERS, AccountRole.MONITOR)
        for account, role in roles.items():
            change_account(site.folder / "accounts.toml", "add", account, role=role, hashed=hashed)

    accounts = 'accounts = "accounts.toml"'
    with (
        recording_controllers() as (robots, arrivals),
        running_site("gateway", "console", tables=robots, console=accounts, prepare=prepare) as running,
    ):
        yield running.console, arrivals


def sign_in(address: str, name: str) -> str:
    """Sign in and return the cookie."""
    body = json.dumps({"name": name, "password": PASSWORD}).encode()
    headers = {"Origin": f"http://{address}", "Content-Type": "application/json"}
    with urlopen(Request(f"http://{address}/account/sign-in", data=body, headers=headers)) as answer:
        return str(answer.headers["Set-Cookie"]).split(";")[0]


# -------------------------------------------------------------------------- the page


@contextlib.contextmanager
def presser(address: str) -> Iterator[Any]:
    """Start the page that presses stop."""
    with piped(page_process, address) as pipe:
        assert pipe.recv() == "ready"
        yield pipe


def press(pipe: Any, number: int, arrivals: Any) -> list[tuple[float, float]]:
    """Press; return the times to the wire and to the answer [s], nan: none."""
    before = [arrivals[index] for index in range(len(ROBOTS))]
    pipe.send(number)
    found = []
    for index, pressed, answered in pipe.recv():
        start = 2 + index * MOST_STOPS
        units = arrivals[start + before[index] : start + arrivals[index]]
        wire = next(((each - pressed) * 1e-9 for each in units if each >= pressed), math.nan)
        found.append((wire, math.nan if answered is None else (answered - pressed) * 1e-9))
    return found


def page_process(address: str, pipe: Any) -> None:
    asyncio.run(press_on_request(address, sign_in(address, OPERATOR), pipe))


async def press_on_request(address: str, cookie: str, pipe: Any) -> None:
    """Watch like a page, and press over its connection for stops, or over its only one of older consoles."""
    numbers = count(1)
    pending: dict[int, asyncio.Future[bool]] = {}

    async def read(socket: ClientConnection) -> None:
        async for data in socket:
            answer = ToPage.FromString(data if isinstance(data, bytes) else data.encode()).answer
            answered = pending.pop(answer.id, None)
            if answered is not None and not answered.done():  # not given up
                answered.set_result(answer.ok)

    async def stop(socket: ClientConnection, index: int) -> tuple[int, int, int | None]:
        number = next(numbers)
        pending[number] = answered = asyncio.get_running_loop().create_future()
        key, at = f"robomesh/bench/{ROBOTS[index]}/stop", time.monotonic_ns()
        ask = FromPage.Ask(id=number, key=key, timeout_s=ANSWER_WITHIN_S)
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(ANSWER_WITHIN_S):
                await socket.send(FromPage(ask=ask).SerializeToString())
                if await answered:
                    return index, at, time.monotonic_ns()
        return index, at, None

    def open_socket(path: str) -> connect:
        return connect(
            f"ws://{address}/{path}",
            origin=f"http://{address}",
            additional_headers={"Cookie": cookie},
            compression=None,
            ping_interval=None,
            max_size=None,
        )

    async with contextlib.AsyncExitStack() as stack:
        page = await stack.enter_async_context(open_socket("mesh"))
        try:
            stops = await stack.enter_async_context(open_socket("stop"))
        except InvalidStatus:
            stops = page
        readers = [asyncio.create_task(read(socket)) for socket in {page, stops}]
        for key in ("joints", "controller", "lease"):
            watch = FromPage.Watch(key=f"robomesh/*/*/{key}")
            await page.send(FromPage(watch=watch).SerializeToString())
        while None in [(await stop(stops, index))[2] for index in range(len(ROBOTS))]:
            await asyncio.sleep(0.2)
        pipe.send("ready")
        while not readers[0].done():
            number = await asyncio.to_thread(pipe.recv)
            presses = []
            for turn in range(number * len(ROBOTS)):
                presses.append(asyncio.create_task(stop(stops, turn % len(ROBOTS))))
                await asyncio.sleep(PRESS_EACH_S)
            pipe.send(await asyncio.gather(*presses))


# ------------------------------------------------------------------------ the floods


def framed(opcode: Opcode, data: bytes = b"", *, fin: bool = True) -> bytes:
    return Frame(opcode, data, fin=fin).serialize(mask=True)


def asked(key: str, payload: bytes = b"") -> bytes:
    ask = FromPage.Ask(id=1, key=key, payload=payload)
    return framed(Opcode.BINARY, FromPage(ask=ask).SerializeToString())


def watched(*keys: str) -> bytes:
    """Return frames that watch and unwatch keys in turn."""
    messages = (
        message
        for key in keys
        for message in (FromPage(watch=FromPage.Watch(key=key)), FromPage(unwatch=FromPage.Unwatch(key=key)))
    )
    return b"".join(framed(Opcode.BINARY, each.SerializeToString()) for each in messages)


def filled(frames: bytes) -> bytes:
    return frames * max(BLOCK // len(frames), 1)


# Name -> a block that is sent again and again; None: see `flood`.
KINDS: dict[str, bytes | None] = {
    "watches": filled(watched("robomesh/*/*/joints")),
    "keys": watched(*(f"robomesh/bench/x{number}/controller" for number in range(2000))),
    "videos": watched(*(f"robomesh/bench/arm/video/x{number}" for number in range(1000))),
    "empty": filled(framed(Opcode.BINARY)),
    "pings": filled(framed(Opcode.PING)),
    "pongs": filled(framed(Opcode.PONG, bytes(125))),
    "invalid": filled(asked("no/such key")),
    "stops": filled(asked("robomesh/bench/arm/stop")),
    "asks": filled(asked("robomesh/bench/arm/audit/find")),
    "huge": asked("robomesh/bench/arm/audit/find", bytes(1_000_000)),
    "fragments": framed(Opcode.BINARY, fin=False) + filled(framed(Opcode.CONT, fin=False)),
    "bytes": None,
    "unread": None,
    "connections": None,
    "requests": None,
    "files": None,
}
MANY = 30  # connections of one source, fewer than the pages that a session may open


def flood(address: str, cookie: str, kind: str, index: int, opened: Any) -> None:
    """Flood the console until this process is ended.

    `bytes`: pings sent one byte at a time. `unread`: invalid requests whose answers are not read.
    `connections`: many pages that open, watch and close. `requests` and `files`: HTTP requests without a
    pause, over many connections. `stops`: over the connection for them, if the console has one.
    """
    many = MANY if kind in ("connections", "requests", "files") else 1
    threads = [
        threading.Thread(target=flood_on, args=(address, cookie, kind, index, opened)) for _ in range(many)
    ]
    for each in threads:
        each.start()


def flood_on(address: str, cookie: str, kind: str, index: int, opened: Any) -> None:
    host, port = address.split(":")
    head = f"Host: {address}\r\nCookie: {cookie}\r\nOrigin: http://{address}\r\n"
    file = "account/sessions" if kind == "requests" else f"assets/{largest_file()}"
    get = f"GET /{file} HTTP/1.1\r\n{head}Accept-Encoding: gzip\r\n\r\n".encode()
    upgrade = (
        "GET /mesh{} HTTP/1.1\r\n" + head + "Connection: Upgrade\r\nUpgrade: websocket\r\n"
        "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n"
    )
    path = "/stop" if kind == "stops" else ""
    while True:
        with contextlib.suppress(OSError), socket.create_connection((host, int(port))) as line:
            opened[index] += 1
            if kind in ("requests", "files"):
                threading.Thread(target=read_all, args=(line,)).start()
                while True:
                    line.sendall(get * 10)
            line.sendall(upgrade.format(path).encode())
            if b" 101 " not in line.recv(4096):
                path = ""
                time.sleep(0.05)
                continue
            if kind == "connections":
                line.sendall(watched("robomesh/*/*/joints"))
                continue
            if kind != "unread":
                threading.Thread(target=read_all, args=(line,)).start()
            if kind == "bytes":
                line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                while True:
                    for byte in framed(Opcode.PING):
                        line.sendall(bytes([byte]))
            block = KINDS["invalid" if kind == "unread" else kind]
            assert block is not None
            while True:
                line.sendall(block)


def largest_file() -> str:
    return max((PAGE / "assets").iterdir(), key=lambda path: path.stat().st_size).name


def read_all(line: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while line.recv(1 << 20):
            pass
