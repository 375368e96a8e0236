"""A monitor and operator on a host of the tests' network, controlled over standard input and output.

Arguments: routers, comma between, and the file with its keys where they take TLS. A line is a JSON list, a
function below and its arguments; each is answered with one line of JSON.
"""

import asyncio
import hashlib
import json
import random
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import zenoh
from google.protobuf import json_format

from robomesh.contract import messages
from robomesh.contract.endpoints import bundle
from robomesh.contract.messages import PROTOBUF
from robomesh.contract.topics import request
from robomesh.errors import NoAnswerError, RobomeshError
from robomesh.publications.subscription import Subscription
from robomesh.requests.server import Request
from robomesh.wire.session import Session, SessionSettings, open_session


class Probe:
    """Watched keys, and the delay of each sample."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self._subscriptions: dict[str, Subscription] = {}
        self._readers: list[asyncio.Task[None]] = []
        self._newest: dict[str, int] = {}
        self._seen: dict[str, list[tuple[float, float, bool, int, float | None]]] = {}

    async def watch(self, expression: str) -> bool:
        """Subscribe from now on."""
        self._subscriptions[expression] = subscription = self._session.subscribe(expression, newest=2000)
        self._seen[expression] = []
        self._readers.append(asyncio.create_task(self._read(expression, subscription)))
        return True

    async def _read(self, expression: str, subscription: Subscription) -> None:
        async for sample in subscription:
            lag_s = (time.time_ns() - sample.header.source_time_ns) * 1e-9
            age_s = sample.late_s + time.monotonic() - sample.received if sample.live else None
            self._newest[sample.key] = sample.header.sequence
            self._seen[expression].append((time.monotonic(), lag_s, sample.live, len(sample.payload), age_s))

    async def samples(self, expression: str) -> list[tuple[float, float, bool, int, float | None]]:
        """Return samples since the last call: (monotonic time, lag behind its source's time, live, bytes, age
        then).
        """
        seen, self._seen[expression] = self._seen[expression], []
        return seen

    async def state(self, expression: str, key: str) -> dict[str, Any]:
        """Return the current age and losses."""
        subscription = self._subscriptions[expression]
        return {"age_s": subscription.age_s(key), "lost": subscription.lost(key), "at": time.monotonic()}

    async def sequence(self, expression: str, key: str) -> dict[str, int]:
        """Return the newest number of a key with an unchanged publisher, and the received and missing ones
        until then.
        """
        subscription = self._subscriptions[expression]
        lost, received = subscription.lost(key), subscription.received
        return {"number": self._newest[key], "lost": lost, "received": received}

    async def until(self, expression: str, key: str, stale_s: float, stale: bool, timeout_s: float) -> Any:
        """Return when a key became stale, or live again [monotonic s]; None: not in time."""
        deadline = time.monotonic() + timeout_s
        while time.monotonic() < deadline:
            age_s = self._subscriptions[expression].age_s(key)
            if (age_s is None or age_s > stale_s) == stale:
                return time.monotonic()
            await asyncio.sleep(0.01)
        return None

    async def ask(self, key: str, values: dict[str, Any], timeout_s: float) -> Any:
        """Return a request's answer or error, and its duration."""
        schema = request(key.split("/", 3)[3]).request
        assert schema is not None
        began = time.monotonic()
        try:
            message = json_format.ParseDict(values, schema())
            answer = await self._session.ask(key, message, timeout_s=timeout_s)
        except RobomeshError as error:
            return {"error": str(error), "began": began, "took_s": time.monotonic() - began}
        return {"answer": as_json(answer), "began": began, "took_s": time.monotonic() - began}

    async def pour(self, site: str, robot: str, view: str, mbit_per_s: float, pictures_per_s: float) -> bool:
        """Publish, from now on, messages as large and as frequent as those of a view of that rate."""
        publisher = self._session.declare_publisher(site, robot, f"video/{view}")
        size = round(mbit_per_s * 1e6 / 8 / pictures_per_s)

        async def put() -> None:
            next_s, count = time.monotonic(), 0
            while True:
                # A key frame is some times the others, each 2 s.
                key_frame = count % round(2 * pictures_per_s) == 0
                payload = random.randbytes(size * (5 if key_frame else 1))
                publisher.put_bytes(payload, source_time_ns=time.time_ns(), key_frame=key_frame)
                count, next_s = count + 1, next_s + 1 / pictures_per_s
                await asyncio.sleep(max(next_s - time.monotonic(), 0.0))

        self._readers.append(asyncio.create_task(put()))
        return True

    async def hold_shape(self, site: str, robot: str, size: int) -> str:
        """Answer for meshes of that many equal bytes; return their SHA-256."""
        mesh = random.randbytes(size)

        async def answer(_: Request) -> bytes:
            return mesh

        self._session.answer(site, robot, "mesh/*", answer)
        return hashlib.sha256(mesh).hexdigest()

    async def shape(self, key: str, timeout_s: float) -> dict[str, Any]:
        """Return a mesh's SHA-256 or the error, and the duration."""
        began = time.monotonic()
        try:
            sha256 = hashlib.sha256(await self._session.ask_bytes(key, timeout_s=timeout_s)).hexdigest()
        except RobomeshError as error:
            return {"error": str(error), "took_s": time.monotonic() - began}
        return {"sha256": sha256, "took_s": time.monotonic() - began}

    async def stop_over_one_link(self, key: str) -> dict[str, float]:
        """Request a stop like any other request, for comparison."""
        began = time.monotonic()
        get = self._session.zenoh_session.get
        await asyncio.to_thread(
            lambda: list(
                get(key, priority=zenoh.Priority.REAL_TIME, timeout=5.0, payload=b"", encoding=PROTOBUF)
            )
        )
        return {"began": began, "took_s": time.monotonic() - began}

    async def last(self, key: str, timeout_s: float) -> Any:
        """Return the last value of a topic."""
        message = await self._session.last(key, timeout_s=timeout_s)
        return None if message is None else as_json(message)

    async def present(self) -> list[str]:
        """Return the participants that are alive."""
        while True:
            with suppress(NoAnswerError):
                return ["/".join(map(str, each)) for each in await self._session.present()]


def as_json(message: Any) -> Any:
    """Return a message as JSON values."""
    return json.loads(messages.encode(message, as_json=True))


async def main() -> None:
    """Execute the requests of standard input, one after the other, until it ends."""
    loop = asyncio.get_running_loop()
    lines: asyncio.Queue[str] = asyncio.Queue()

    def read() -> None:
        for line in sys.stdin:
            loop.call_soon_threadsafe(lines.put_nowait, line)
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(lines.put_nowait, "")

    threading.Thread(target=read, daemon=True).start()
    routers, *keys = sys.argv[1:]
    settings = SessionSettings(
        connect=tuple(routers.split(",")), tls=bundle(Path(keys[0])) if keys else None, wait_s=120.0
    )
    async with open_session(settings) as session:
        probe = Probe(session)
        print("ready", flush=True)
        while line := await lines.get():
            name, *arguments = json.loads(line)
            print(json.dumps(await getattr(probe, name)(*arguments)), flush=True)


if __name__ == "__main__":
    asyncio.run(main())
