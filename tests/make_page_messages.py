"""Record what a site's console sends a page, for the page's unit tests.

    ./dev run python tests/make_page_messages.py

The site is a real one with a simulated Pt600. An operator takes control of it, moves it, is refused, jogs,
stops, resets and leaves. web/tests/messages/site.bin gets every message, after its time and length.
"""

import asyncio
import contextlib
import struct
import sys
import tempfile
import time
from pathlib import Path

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[1])

from websockets.asyncio.client import ClientConnection, connect

import robomesh
from robomesh.contract.topics import TOPICS
from robomesh.schemas.robomesh_pb2 import FromPage, ToPage
from tests.site import RunningSite, running_site

FILE = Path(__file__).resolve().parents[1] / "web" / "tests" / "messages" / "site.bin"
# Seconds since the first message, length of the message.
PREFIX = struct.Struct("<dI")
RATE_HZ = 10.0
ROBOT = """
[[robot]]
name = "arm"
model = "pt600"
"""


async def main() -> None:
    """Run the site and write the file."""
    recorded: list[tuple[float, bytes]] = []
    with (
        tempfile.TemporaryDirectory() as folder,
        running_site(Path(folder), robots=ROBOT, services=("recorder", "watch", "store")) as site,
    ):
        page = site.console.replace("http", "ws") + "mesh"
        async with connect(page, max_size=None, origin=site.console.rstrip("/")) as socket:
            reading = asyncio.create_task(record(socket, recorded))
            await asyncio.to_thread(operate, site)
            await asyncio.sleep(0.5)
            reading.cancel()
            await asyncio.wait([reading])
    FILE.parent.mkdir(exist_ok=True)
    first = recorded[0][0]
    FILE.write_bytes(b"".join(PREFIX.pack(at - first, len(each)) + each for at, each in recorded))
    print(f"{FILE}: {len(recorded)} messages, {FILE.stat().st_size / 1000:.0f} kB")


async def record(socket: ClientConnection, recorded: list[tuple[float, bytes]]) -> None:
    """Watch every topic and keep each message, but of a topic with a rate ten a second at most."""
    for topic in TOPICS:
        if topic.endswith("/*") and topic != "events/*":  # of one view or process
            continue
        watch = FromPage.Watch(key=f"robomesh/*/*/{topic}")
        await socket.send(FromPage(watch=watch).SerializeToString())
    kept: dict[str, float] = {}
    async for message in socket:
        assert isinstance(message, bytes)
        at, sample = time.monotonic(), ToPage.FromString(message).sample
        topic = TOPICS.get(sample.key.split("/")[3]) if sample.key else None
        if topic and topic.rate_hz and at - kept.get(sample.key, 0.0) < 1 / RATE_HZ:
            continue
        kept[sample.key] = at
        recorded.append((at, message))


def operate(site: RunningSite) -> None:
    """Do what an operator does."""
    with robomesh.connect(site.router) as mesh:
        robot = mesh.robot("test/arm")
        with robot.control("li") as arm:
            arm.home()
            arm.move_joints_by_deg([5.0, 0.0, 0.0, 0.0, 0.0])
            with contextlib.suppress(robomesh.RobomeshError):
                arm.move_joints_deg([400.0] * 5)
            arm.move_joints_by_deg([60.0, 0.0, 0.0, 0.0, 0.0], wait=False)
            arm.stop("a person came near")
            arm.reset()


if __name__ == "__main__":
    asyncio.run(main())
