"""The console's server: serves the built page and connects its WebSockets to the mesh."""

import asyncio
import contextlib
import functools
import logging
import ssl
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path

from pydantic import InstanceOf
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.types import ASGIApp, Scope
from starlette.websockets import WebSocket

from robomesh import reason_codes as codes
from robomesh.contract import keys, topics
from robomesh.contract.keys import PresenceKey
from robomesh.errors import NoAnswerError
from robomesh.listen_address import check_page_reach, split_address
from robomesh.recordings.series.values import live_topics
from robomesh.schemas.robomesh_pb2 import Event, ToPage
from robomesh.service.health import own_version
from robomesh.wire.session import Session
from services.console.accounts.auth_middleware import SIGNED_OUT, AuthMiddleware, cookie_name
from services.console.accounts.auth_service import AuthService
from services.console.accounts.rights import operator_name
from services.console.accounts.routes import AccountRoutes, client_address
from services.console.accounts.sessions import MOST_PAGES, SignedIn
from services.console.common.error_responses import as_json, as_text
from services.console.common.errors import PageNotBuiltError, RefusedRequest
from services.console.common.guard import Guard
from services.console.common.requested_views import Views
from services.console.define.routes import Define
from services.console.define.settings import DefineSettings
from services.console.http import png
from services.console.http.layouts import layout_response
from services.console.http.page_files import PageFiles
from services.console.http.pictures import MJPEG, Pictures
from services.console.http.recorded_video import RecordedVideo
from services.console.http.recordings import Recordings
from services.console.http.shapes import ShapeCache, shape_response
from services.console.http.view_page import ViewPage
from services.console.serving.listener import listening
from services.console.serving.uvicorn_server import (
    follow_certificate,
    serve_until_cancelled,
    server_of,
    tls_context,
)
from services.console.websocket.page_connection import PageConnection
from services.console.websocket.shared_subscriptions import SharedSubscriptions
from services.console.websocket.websocket_transport import transport_of
from services.site_file.tables.console import Console

log = logging.getLogger(__name__)

PAGE = Path(__file__).parent / "page"  # built from `web/`

_CONNECTION_CHECK_EVERY_S = 0.5


class Settings(Console):
    """Address, security and content of the console.

    Attributes:
        site: The console's own site; the page shows every site that its router reaches.
        page: Folder of the built page.
        define: Settings of the page's Define; None: robots cannot be defined here.
    """

    site: str
    page: Path = PAGE
    define: InstanceOf[DefineSettings] | None = None


async def serve(
    session: Session, settings: Settings, *, on_ready: Callable[[str], None] | None = None
) -> None:
    """Serve the page until cancelled.

    Args:
        on_ready: Called with the page's address once it can be opened.

    Raises:
        ListenError: If the address is in use, or must not be served insecurely.
        AccountsError: If the accounts file is invalid.
        PageNotBuiltError: If the page is not built.
    """
    if not (settings.page / "index.html").exists():
        raise PageNotBuiltError(f"no page in {settings.page}: build it with `python web/build_page.py`")
    host, port = split_address(settings.listen)
    warning = reach_warning(settings, host)
    if warning is not None:
        log.warning("%s", warning)
    tls = None if settings.tls is None else tls_context(settings.tls.certificate, settings.tls.key)
    with listening(host, port) as listener:
        hub = Hub(session, settings, exposed=warning is not None, tls=tls)
        guarded = Guard(application(hub), settings.hosts, secure=tls is not None, embed=settings.embed)
        bound_port = listener.getsockname()[1]
        address = f"http{'s' if tls else ''}://{f'[{host}]' if ':' in host else host}:{bound_port}"
        async with hub:
            await serve_until_cancelled(server_of(guarded, tls), listener, address, on_ready)


def reach_warning(settings: Settings, host: str) -> str | None:
    """Return the warning about an insecure address, or None.

    Raises:
        ListenError: If other machines can reach it, without accounts or TLS, and without `insecure`.
    """
    return check_page_reach(
        host,
        accounts=settings.accounts is not None,
        tls=settings.tls is not None,
        insecure=settings.insecure,
    )


class Hub:
    """State that all pages share: subscriptions, presence, shapes, accounts."""

    def __init__(
        self, session: Session, settings: Settings, *, exposed: bool, tls: ssl.SSLContext | None = None
    ) -> None:
        self.session = session
        self.settings = settings
        self.shapes = ShapeCache()
        self.subscriptions = SharedSubscriptions(session)
        self.views = Views(session)
        self.recorded_video = RecordedVideo(session, self.asker)
        self.pictures = Pictures(self.subscriptions, self.views, session, self.asker)
        self._alive: set[PresenceKey] = set()
        # After a start or a lost link, tokens arrive one by one.
        self._presence_known = False
        self._connections: set[PageConnection] = set()
        self._closed_connections = Counter[str]()  # samples of closed connections
        self.exposed = exposed
        self._tls = tls
        self.auth = None if settings.accounts is None else self._open_auth(settings.accounts)
        self._tasks: list[asyncio.Task[None]] = []
        self.define = None if settings.define is None else Define(settings.define)
        session.measure("browsers", "Pages that are open", lambda: len(self._connections))
        for name, text in (("offered", "that came for pages"), ("sent", "that were sent to pages")):
            session.measure(
                f"page_samples_{name}_total", f"Samples {text}", functools.partial(self._count, name)
            )

    async def __aenter__(self) -> "Hub":
        work = (
            self._watch_presence(),
            self._watch_presence_known(),
            self._watch_router(),
            asyncio.to_thread(png.prepare),
        )
        self._tasks = [asyncio.create_task(each) for each in work]
        if self.auth is not None:
            self._tasks.append(asyncio.create_task(self.auth.follow()))
        files = self.settings.tls
        if self._tls is not None and files is not None:
            follow = follow_certificate(self._tls, files.certificate, files.key)
            self._tasks.append(asyncio.create_task(follow))
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self._tasks:
            task.cancel()
        self.subscriptions.close()
        if self.auth is not None:
            self.auth.close()
        if self.define is not None:
            await self.define.close()
        await self.recorded_video.close()

    async def connect_page(self, websocket: WebSocket) -> None:
        """Serve one page's WebSocket; a page sends its stops over one of their own."""
        stops_only = websocket.scope["path"].endswith("/stop")
        user: SignedIn | None = websocket.scope.get("signed_in")
        if user is not None and len(user.pages) >= MOST_PAGES and not stops_only:
            refused = RefusedRequest(403, codes.PAGE_TOO_MANY_PAGES(count=MOST_PAGES))
            await websocket.send_denial_response(as_json(refused))
            return
        asker = client_address(websocket.scope) if user is None else user.account.name
        await transport_of(websocket).limit(asker, stops=stops_only)
        await websocket.accept()
        connection = PageConnection(
            self.session,
            self.subscriptions,
            self.views,
            greet=self._hello,
            site=self.settings.site,
            user=user,
            own_name=self._own_name(user),
            stops_only=stops_only,
        )
        if not stops_only:
            for each in self._alive:
                connection.send_message(_presence(each, alive=True))
            self._connections.add(connection)
            if self._presence_known:
                connection.greet()  # again, now that it has all presence
        try:
            if user is None:
                await connection.run(websocket)
            else:
                await _serve_signed_in(connection, user, websocket)
        finally:
            self._connections.discard(connection)
            self._closed_connections.update(offered=connection.offered, sent=connection.sent)

    def _count(self, name: str) -> int:
        now: int = sum(getattr(connection, name) for connection in tuple(self._connections))
        return self._closed_connections[name] + now

    def _open_auth(self, accounts: Path) -> AuthService:
        events = self.session.declare_publisher(self.settings.site, keys.WHOLE_SITE, "events/console")

        def publish_event(severity: Event.Severity, code: str, text: str, values: Mapping[str, str]) -> None:
            event = Event(severity=severity, code=code, text=text, source="console", values=values)
            event.timestamp.GetCurrentTime()
            events.put(event)

        return AuthService(accounts, self.settings.site, publish_event)

    def asker(self, scope: Scope) -> str:
        """Return the name for requests over HTTP: the account's, otherwise the console's."""
        return self._own_name(scope.get("signed_in")) or self.session.own_name

    def _own_name(self, user: SignedIn | None) -> str:
        """Return the operator that a page acts as; empty if it may use any name, without certificates.

        The router lets a console act under every name of its site, for its accounts. Without accounts all
        pages act under the console's own name, and share its quotas.
        """
        if user is not None:
            return operator_name(user.account.name, self.settings.site)
        return "" if self.session.principal is None else self.session.principal.name

    def _hello(self, connection: PageConnection) -> ToPage:
        hello = ToPage.Hello(
            version=own_version(),
            site=self.settings.site,
            insecure=self.exposed,
            connected=self.session.connected,
            session=connection.operator.id,
            may_command=connection.user is None or connection.user.may_command,
            operator=connection.own_name,
            presence_known=self._presence_known and connection in self._connections,
        )
        if connection.user is not None:
            hello.account = connection.user.account.name
        for name, row in topics.TOPICS.items():
            if row.stale_after_s is not None:
                hello.stale.add(topic=name, after_s=row.stale_after_s)
        for name, values_schema in live_topics().items():
            hello.values.add(topic=name, schema=values_schema)
        return ToPage(hello=hello)

    async def _watch_presence(self) -> None:
        async for token, alive in self.session.watch_presence():
            (self._alive.add if alive else self._alive.discard)(token)
            for connection in self._connections:
                connection.send_message(_presence(token, alive=alive))

    async def _watch_presence_known(self) -> None:
        while True:
            await asyncio.sleep(_CONNECTION_CHECK_EVERY_S)
            if not self.session.connected:
                self._presence_known = False
            elif not self._presence_known:
                with contextlib.suppress(NoAnswerError):
                    self._presence_known = self._alive.issuperset(await self.session.present())
                if self._presence_known:
                    for connection in self._connections:
                        connection.greet()

    async def _watch_router(self) -> None:
        connected = self.session.connected
        while True:
            await asyncio.sleep(_CONNECTION_CHECK_EVERY_S)
            if self.session.connected is not connected:
                connected = not connected
                for connection in self._connections:
                    connection.greet()


async def _serve_signed_in(connection: PageConnection, user: SignedIn, websocket: WebSocket) -> None:
    """Serve a page as long as its session lasts; close it with the reason when the session ends."""
    try:
        with (
            user.serving(),
            contextlib.nullcontext() if connection.stops_only else user.with_page(connection),
        ):
            await connection.run(websocket)
    except asyncio.CancelledError:
        if not user.ended:
            raise
        await websocket.close(SIGNED_OUT, user.ended)


def application(hub: Hub) -> ASGIApp:
    """Return the app with all its routes; with accounts, every request passes the authentication middleware.

    `/mesh` and `/mesh/stop` (WebSockets), `/mesh/<site>/<robot>/<name>`, layouts of other viewers, pictures,
    pages of single views, recordings, Define, `/account`, `/health`, the page.
    """
    settings, secure = hub.settings, hub.settings.tls is not None
    cookie = cookie_name(settings.site, secure=secure)
    account = AccountRoutes(hub.auth, site=settings.site, cookie=cookie, secure=secure, insecure=hub.exposed)

    async def mesh(request: Request) -> Response:
        return await shape_response(request, hub.session, hub.shapes)

    async def layout(request: Request) -> Response:
        return await layout_response(request, hub.session)

    async def health(_: Request) -> Response:
        return JSONResponse({"mesh": hub.session.connected}, headers={"Cache-Control": "no-store"})

    viewing = [*hub.pictures.routes(), *ViewPage(hub.session, hub.pictures, settings.page).routes()]
    routes: list[BaseRoute] = [
        Route("/health", health, methods=["GET"]),
        *account.routes(),
        WebSocketRoute("/mesh", hub.connect_page),
        WebSocketRoute("/mesh/stop", hub.connect_page),
        Route("/mesh/{site}/{robot}/{name}", mesh, methods=["GET"]),
        Route("/layout/{site}/{robot}.json", layout, methods=["GET"]),
        *viewing,
        *Recordings(hub.session, hub.asker).routes(),
        *hub.recorded_video.routes(),
        *([] if hub.define is None else [hub.define.routes()]),
        Mount("/", PageFiles(directory=hub.settings.page, html=True)),
    ]
    packed = Middleware(
        GZipMiddleware,
        minimum_size=1024,
        compresslevel=5,
        exclude_content_types=(*DEFAULT_EXCLUDED_CONTENT_TYPES, MJPEG, "application/octet-stream"),
    )
    refusals = {HTTPException: _refused_by_routing, Exception: _failed}
    app = Starlette(routes=routes, middleware=[packed], exception_handlers=refusals)
    return app if hub.auth is None else AuthMiddleware(app, hub.auth, cookie, viewing)


async def _refused_by_routing(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    path = request.url.path
    if error.status_code == 405:
        reason = codes.HTTP_METHOD(path=path, method=request.method)
    else:
        reason = codes.HTTP_NO_PATH(path=path)
    answer = as_text(RefusedRequest(error.status_code, reason))
    answer.headers.update(error.headers or {})
    return answer


async def _failed(request: Request, _: Exception) -> Response:
    return as_text(RefusedRequest(500, codes.FAILED(request=request.url.path)))


def _presence(token: PresenceKey, *, alive: bool) -> ToPage:
    key = keys.presence_key(token.site, token.robot, token.service, token.id)
    return ToPage(presence=ToPage.Presence(key=key, alive=alive))
