"""The console's server: the built page, the WebSocket behind it, the meshes it draws."""

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import Scope
from starlette.websockets import WebSocket

from bus import keys, topics
from bus.keys import PresenceKey
from bus.schemas.robomesh_pb2 import ToPage
from bus.session import Session
from services.console.browser import Browser
from services.console.errors import PageNotBuiltError
from services.console.feeds import Feeds
from services.console.guard import Guard
from services.console.meshes import MeshCache, mesh_response
from services.errors import ListenError
from services.listen import check_reach, split_address

log = logging.getLogger(__name__)

PAGE = Path(__file__).parent / "page" / "dist"

# What the system may hold back for a slow browser: a second of state, not a minute of it.
_SEND_BUFFER = 128 * 1024
_CONNECTED_EACH_S = 0.5


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Where the page is served.

    Attributes:
        site: The console's own site; the page shows every site that its router reaches.
        listen: `HOST:PORT`; port 0 takes a free one.
        insecure: Beyond loopback without TLS or accounts, at the site's own risk.
        hosts: Names that the console is known by, beside `localhost` and addresses.
        page: Folder of the built page.
    """

    site: str
    listen: str = "127.0.0.1:8080"
    insecure: bool = False
    hosts: tuple[str, ...] = ()
    page: Path = PAGE


async def serve(
    session: Session, settings: Settings, *, on_ready: Callable[[str], None] | None = None
) -> None:
    """Serves the page until it is cancelled.

    Args:
        on_ready: Told the page's address once it can be opened.

    Raises:
        ListenError: If it cannot listen there, or may not.
        PageNotBuiltError: If there is no page.
    """
    if not (settings.page / "index.html").exists():
        raise PageNotBuiltError(
            f"no page in {settings.page}: build it with `python services/console/build_page.py`"
        )
    host, port = split_address(settings.listen)
    warning = check_reach("the console", host, secured=False, insecure=settings.insecure)
    if warning is not None:
        log.warning("%s", warning)
    with _listening(host, port) as listener:
        hub = Hub(session, settings, exposed=warning is not None)
        config = uvicorn.Config(
            Guard(application(hub), settings.hosts),
            ws="websockets-sansio",
            ws_per_message_deflate=False,
            ws_max_size=1 << 20,
            lifespan="off",
            log_config=None,
            log_level="warning",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        bound_port = listener.getsockname()[1]
        address = f"http://{f'[{host}]' if ':' in host else host}:{bound_port}"
        async with hub:
            await _serve_until_cancelled(_Server(config), listener, address, on_ready)


class Hub:
    """What all browsers share: the feeds, who is alive, the meshes."""

    def __init__(self, session: Session, settings: Settings, *, exposed: bool) -> None:
        self.session = session
        self.settings = settings
        self.meshes = MeshCache()
        self._feeds = Feeds(session)
        self._alive: set[PresenceKey] = set()
        self._browsers: set[Browser] = set()
        self._exposed = exposed
        self._tasks: list[asyncio.Task[None]] = []

    async def __aenter__(self) -> "Hub":
        self._tasks = [asyncio.create_task(work) for work in (self._watch_presence(), self._watch_router())]
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self._tasks:
            task.cancel()
        self._feeds.close()

    async def browse(self, websocket: WebSocket) -> None:
        """Serves one browser."""
        await websocket.accept()
        browser = Browser(self.session, self._feeds)
        browser.tell(self._hello())
        for who in self._alive:
            browser.tell(_presence(who, alive=True))
        self._browsers.add(browser)
        try:
            await browser.run(websocket)
        finally:
            self._browsers.discard(browser)

    def _hello(self) -> ToPage:
        hello = ToPage.Hello(
            version=_version(),
            site=self.settings.site,
            insecure=self._exposed,
            connected=self.session.connected,
        )
        for name, row in topics.TOPICS.items():
            if row.stale_after_s is not None:
                hello.stale.add(topic=name, after_s=row.stale_after_s)
        return ToPage(hello=hello)

    async def _watch_presence(self) -> None:
        async for who, alive in self.session.watch_presence():
            (self._alive.add if alive else self._alive.discard)(who)
            for browser in self._browsers:
                browser.tell(_presence(who, alive=alive))

    async def _watch_router(self) -> None:
        connected = self.session.connected
        while True:
            await asyncio.sleep(_CONNECTED_EACH_S)
            if self.session.connected is not connected:
                connected = not connected
                for browser in self._browsers:
                    browser.tell(self._hello())


def application(hub: Hub) -> Starlette:
    """The routes: `/mesh` (WebSocket), `/mesh/<site>/<robot>/<name>` (GLB), and the page."""

    async def mesh(request: Request) -> Response:
        return await mesh_response(request, hub.session, hub.meshes)

    routes: list[BaseRoute] = [
        WebSocketRoute("/mesh", hub.browse),
        Route("/mesh/{site}/{robot}/{name}", mesh, methods=["GET"]),
        Mount("/", PageFiles(directory=hub.settings.page, html=True)),
    ]
    return Starlette(
        routes=routes, middleware=[Middleware(GZipMiddleware, minimum_size=1024, compresslevel=5)]
    )


class PageFiles(StaticFiles):
    """The built page: hashed assets for ever, the rest asked for each time."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """A file, with how long it may be kept."""
        response = await super().get_response(path, scope)
        hashed = path.startswith("assets/") and response.status_code == 200
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable" if hashed else "no-store"
        return response


class _Server(uvicorn.Server):
    """uvicorn without its own signal handling: the service is cancelled instead."""

    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leaves the signals to `bus.service.run`."""
        yield


async def _serve_until_cancelled(
    server: _Server, listener: socket.socket, address: str, on_ready: Callable[[str], None] | None
) -> None:
    serving = asyncio.create_task(server.serve(sockets=[listener]))
    try:
        while not server.started and not serving.done():
            await asyncio.sleep(0.005)  # uvicorn tells in no other way
        log.info("console %s", address)
        if on_ready is not None:
            on_ready(address)
        await asyncio.shield(serving)
    finally:
        server.should_exit = True
        server.force_exit = True  # browsers come back by themselves
        await asyncio.gather(serving, return_exceptions=True)


@contextlib.contextmanager
def _listening(host: str, port: int) -> Iterator[socket.socket]:
    """A listening socket whose connections hold little back.

    Raises:
        ListenError: If the address is taken, or not ours.
    """
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        listener = socket.socket(family, kind, protocol)
    except OSError as error:
        raise ListenError(f"the console cannot listen on {host}:{port}: {error.strerror}") from None
    with listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
        try:
            listener.bind(address)
        except OSError as error:
            raise ListenError(
                f"the console cannot listen on {host}:{port}: {error.strerror}; free it, or name another "
                "with [console] listen"
            ) from None
        yield listener


def _presence(who: PresenceKey, *, alive: bool) -> ToPage:
    key = keys.presence_key(who.site, who.robot, who.service, who.id)
    return ToPage(presence=ToPage.Presence(key=key, alive=alive))


def _version() -> str:
    try:
        return version("robomesh")
    except PackageNotFoundError:
        return "unknown"
