"""A running console with Define, and a client that acts like a page."""

import asyncio
import json
import threading
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robomesh.wire.session import SessionSettings, open_session
from services.console.app import Settings, serve
from services.console.define.settings import DefineSettings
from services.site_file.site import Define, Site
from services.site_file.tables.robot import Robot
from tests.services.http_refusals import read_refusal


@dataclass
class Answer:
    """A response."""

    status: int
    body: bytes
    headers: Any

    @property
    def json(self) -> Any:
        """Return the response's JSON."""
        return json.loads(self.body)

    @property
    def code(self) -> str:
        """Return the code of a refusal."""
        return read_refusal({"content-type": self.headers["Content-Type"]}, self.body).code

    @property
    def text(self) -> str:
        """Return the response's text."""
        return self.body.decode()


@dataclass
class Page:
    """A page's client."""

    address: str
    folder: Path

    def get(self, path: str, **headers: str) -> Answer:
        """Send a GET request."""
        return self._ask(urllib.request.Request(f"{self.address}/define{path}", headers=headers))

    def post(self, path: str, body: Any = None, **headers: str) -> Answer:
        """Send a POST request, by default from the page's own origin."""
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        headers = {"Origin": self.address} | headers
        return self._ask(
            urllib.request.Request(
                f"{self.address}/define{path}",
                data=data,
                headers={name: value for name, value in headers.items() if value},
            )
        )

    def upload(self, content: bytes, name: str = "a.wrl") -> str:
        """Upload a file; return its SHA-256."""
        answer = self.post(f"/files?name={name}", content)
        assert answer.status == 200, answer.text
        sha: str = answer.json["sha"]
        return sha

    def draft(self, robot: str = "pt500", name: str = "mine") -> dict[str, Any]:
        """Return a library robot as a draft with another name."""
        found = self.get(f"/robots/{robot}").json
        return {"description": found["description"] | {"name": name}, "files": found["files"]}

    @staticmethod
    def _ask(request: urllib.request.Request) -> Answer:
        try:
            with urllib.request.urlopen(request, timeout=200.0) as answer:
                return Answer(answer.status, answer.read(), answer.headers)
        except urllib.error.HTTPError as error:
            with error:
                return Answer(error.code, error.read(), error.headers)


@contextmanager
def defining(mesh: SessionSettings, folder: Path, **settings: Any) -> Iterator[Page]:
    """Yield a running console with Define, in its own thread."""
    page = folder / "page"
    page.mkdir()
    (page / "index.html").write_text("<!doctype html>")
    site = Site(site="s", robot=(Robot(name="arm", model="pt600"),), define=Define(folder=folder / "robots"))
    define = DefineSettings(site=site, store=folder / "store", **{"can_start": True, **settings})
    loop = asyncio.new_event_loop()
    address: list[str] = []
    ready = threading.Event()

    async def main() -> None:
        def on_ready(text: str) -> None:
            address.append(text)
            ready.set()

        async with open_session(mesh) as session:
            console = Settings(site="s", listen="127.0.0.1:0", page=page, define=define)
            await serve(session, console, on_ready=on_ready)

    task = loop.create_task(main())

    def work() -> None:
        try:
            loop.run_until_complete(asyncio.gather(task, return_exceptions=True))
        finally:
            ready.set()
            loop.close()

    thread = threading.Thread(target=work)
    thread.start()
    try:
        assert ready.wait(20.0)
        assert address, task
        yield Page(address[0], folder)
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join(20.0)
        assert not thread.is_alive()
