"""A session on the mesh: a client of a router, with its publishers, subscriptions and servers of requests."""

import asyncio
import logging
import os
import secrets
import threading
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import partial

import zenoh
from google.protobuf.message import Message

from robomesh import reason_codes as codes
from robomesh.contract import access_rights, keys, topics
from robomesh.contract.endpoints import DEFAULT_ROUTER, Tls, client_config, first_line
from robomesh.contract.ignored import REPLY, Ignored
from robomesh.errors import BrokenAnswerError, NoAnswerError, NoRightError, SessionError
from robomesh.files import forked
from robomesh.publications.late_joiners import AnsweringThread
from robomesh.publications.outbox import Outbox
from robomesh.publications.publisher import OnGet, Publisher
from robomesh.publications.subscription import Subscription
from robomesh.reasons import Reason
from robomesh.requests import requests, server
from robomesh.requests.request_queue import RoundRobin
from robomesh.wire import connect_errors, presence
from robomesh.wire.counters import Counters, Measure

log = logging.getLogger(__name__)

_RETRY_S = 0.25
# A router reopens for new rules in milliseconds, and restarts in seconds.
_ROUTER_RETURNS_S = 10.0
# Messages that `last` keeps while it waits for a list.
_AFTER_LIST = 1000
# Name of a measure: remaining validity of the certificate, if there is one [s].
CERTIFICATE = "certificate_seconds"

_Declared = Publisher | Subscription | server.RequestServer | presence.PresenceWatch


@dataclass(frozen=True, kw_only=True)
class SessionSettings:
    """Routers to try, in order, and the certificates for them.

    Attributes:
        wait_s: How long to wait for a router at the start [s]; None: forever, with a log line.
    """

    connect: tuple[str, ...] = (DEFAULT_ROUTER,)
    tls: Tls | None = None
    wait_s: float | None = None


@dataclass
class Session:
    """An open session. Closing it closes everything declared on it."""

    _opened: zenoh.Session
    # Of the additional connections.
    extra_config: zenoh.Config
    # From the certificate; None: no certificate, or one without identity lines.
    principal: access_rights.Principal | None = None
    # Id of this process in presence keys.
    identity: str = field(default_factory=lambda: secrets.token_hex(4))
    # Metrics that the service defines.
    measures: list[Measure] = field(default_factory=list)
    # What the service does without, by name, and tries again.
    problems: dict[str, Reason] = field(default_factory=dict)
    # Messages on invalid keys.
    ignored: Ignored = field(default_factory=Ignored)
    _declared: list[_Declared] = field(default_factory=list)
    _closed_counters: Counters = field(default_factory=Counters)
    _declared_lock: threading.Lock = field(default_factory=threading.Lock)
    _tokens: list[zenoh.LivelinessToken] = field(default_factory=list)
    _refresher: asyncio.Task[None] | None = None
    _answering: AnsweringThread = field(default_factory=AnsweringThread)
    # Of the publishers whose messages are put together.
    _outbox: Outbox | None = None
    # Starts the handlers of all servers of requests.
    _scheduler: RoundRobin | None = None
    # Additional connections by their names in the topic table.
    _extra: dict[str, zenoh.Session] = field(default_factory=dict)
    _extra_lock: threading.Lock = field(default_factory=threading.Lock)
    _pid: int = field(default_factory=os.getpid)

    @property
    def zenoh_session(self) -> zenoh.Session:
        """The main connection.

        Raises:
            ForkedError: In a process that was forked from the session's.
        """
        forked.check_owner(self._pid)
        return self._opened

    @property
    def connected(self) -> bool:
        """True while a router is connected."""
        return bool(self.zenoh_session.info.routers_zid())

    @property
    def own_name(self) -> str:
        """Name for requests: the certificate's; without a certificate this process's id."""
        return self.identity if self.principal is None else self.principal.name

    def declare_publisher(
        self, site: str, robot: str, topic: str, *, on_get: OnGet | None = None, together: bool = False
    ) -> Publisher:
        """Declare the publisher of a topic of the table.

        Args:
            on_get: Returns the answer for late joiners instead of the last value.
            together: Put the messages of one iteration of the event loop directly after each other, at its
                end, which saves processor time; such a publisher is for the event loop's thread only.

        Raises:
            NoRightError: If the certificate does not allow it.
        """
        self._check("put", keys.robot_key(site, robot, topic))
        if together and self._outbox is None:
            self._outbox = Outbox()
        outbox = self._outbox if together else None
        publisher = Publisher(
            self.zenoh_session,
            site,
            robot,
            topic,
            answering=self._answering,
            on_get=on_get,
            outbox=outbox,
        )
        self._keep(publisher)
        return publisher

    def subscribe(self, key_expr: str, *, newest: int = 1, history: bool = True) -> Subscription:
        """Subscribe to a topic of one robot, or of many with a wildcard.

        Args:
            newest: Number of samples kept for a slow consumer, over all keys; older ones are dropped.
            history: Begin with the last value, and query it again when a service comes back.
        """
        subscription = Subscription(
            self.zenoh_session, key_expr, newest=newest, history=history, ignored=self.ignored
        )
        self._keep(subscription)
        if history and self._refresher is None:
            self._refresher = asyncio.create_task(self._refresh())
        return subscription

    async def ask(
        self, key: keys.Key | str, request: Message | None = None, *, timeout_s: float = 2.0
    ) -> Message:
        """Send a request and return its answer.

        Raises:
            NoRightError: If the certificate does not allow it.
            RefusedError: If the owner refused; with its sentence.
            NoAnswerError: If no answer arrived in time.
        """
        key = keys.parse_expression(key)
        payload = b"" if request is None else request.SerializeToString()
        return requests.decode_answer(key, await self.ask_bytes(key, payload, timeout_s=timeout_s))

    async def ask_bytes(self, key: keys.Key | str, payload: bytes = b"", *, timeout_s: float = 2.0) -> bytes:
        """Send a request as bytes and return the answer's bytes; see `ask`."""
        key = keys.parse_expression(key)
        self._check("query", key)
        try:
            return await requests.ask_bytes(self.zenoh_session, key, payload, timeout_s=timeout_s)
        except NoAnswerError as error:
            if self.principal is None or isinstance(error, BrokenAnswerError):
                raise
            # A router rejects silently.
            reason = codes.NO_ANSWER_OR_REVOKED(error.reason, name=self.principal.name)
            raise NoAnswerError(reason) from None

    async def ask_all(
        self, key: str, request: Message | None = None, *, timeout_s: float = 2.0
    ) -> list[requests.Answer]:
        """Send a request on a key with a wildcard and return every owner's answer."""
        asked = keys.parse_expression(key)
        self._check("query", asked)
        payload = b"" if request is None else request.SerializeToString()
        answers = await requests.ask_all(self.zenoh_session, asked, payload, timeout_s=timeout_s)
        # A refusal has the request's key instead of its owner's.
        return [
            requests.answer_of(owner, answer, refused)
            for text, answer, refused in answers
            if (owner := asked if text == key else self.ignored.key(REPLY, text)) is not None
        ]

    async def last(self, key: str, *, timeout_s: float = 2.0) -> Message | None:
        """Return the last value of a topic, or its history message; None: no publisher has one."""
        # Messages that follow a list must not push it out before it is read.
        newest = 1 if topics.topic(keys.parse_expression(key).topic).history_schema is None else _AFTER_LIST
        subscription = Subscription(
            self.zenoh_session, key, newest=newest, history=True, ignored=self.ignored
        )
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    sample = await anext(subscription)
                    # For a list topic return the list, not a message published in the meantime.
                    if not sample.live or subscription.topic.history_schema is None:
                        return sample.message()
        except (TimeoutError, StopAsyncIteration):
            return None
        finally:
            subscription.close()

    def answer(
        self,
        site: str,
        robot: str,
        name: str,
        handler: server.Handler,
        *,
        on_refused: server.OnRefused = lambda chunk, reason: None,
        recall: server.Recall = lambda: None,
    ) -> server.RequestServer:
        """Answer a request of the table: `stop`, `command/*`.

        Args:
            on_refused: Called for an invalid request, which the handler does not see.
            recall: For stops: returns what answers a repeated one, which the handler does not see.

        Raises:
            NoRightError: If the certificate does not allow it.
            SessionError: If the request needs an additional connection and the router stays away.
        """
        self._check("declare_queryable", keys.robot_key(site, robot, name))
        connection = self.connection(topics.request(name).own_link, wait_s=_ROUTER_RETURNS_S)
        if self._scheduler is None:
            self._scheduler = RoundRobin()
        declared = server.RequestServer(
            connection,
            site,
            robot,
            name,
            handler,
            scheduler=self._scheduler,
            on_refused=on_refused,
            recall=recall,
            ignored=self.ignored,
        )
        self._keep(declared)
        return declared

    def declare_presence(self, site: str, robot: str, service: str) -> None:
        """Declare that a service is alive for a robot (`-`: for the whole site)."""
        key = keys.presence_key(site, robot, service, self.identity)
        self._tokens.append(self.zenoh_session.liveliness().declare_token(key))

    def declare_presence_of(
        self, site: str, robot: str, service: str, identity: str
    ) -> zenoh.LivelinessToken:
        """Declare the presence of a session that this process represents; undeclare the returned token."""
        key = keys.presence_key(site, robot, service, identity)
        return self.zenoh_session.liveliness().declare_token(key)

    def watch_presence(self, key_expr: str = presence.EVERYTHING) -> presence.PresenceWatch:
        """Watch changes of presence; the tokens alive now come first."""
        watch = presence.PresenceWatch(self.zenoh_session, key_expr, self.ignored)
        self._keep(watch)
        return watch

    async def present(self) -> list[keys.PresenceKey]:
        """Return the presence keys of all services of the mesh, sorted.

        Raises:
            NoAnswerError: If the router did not list all tokens in time.
        """
        # If the session also watches presence, Zenoh omits tokens in 1 % to 5 % of the replies.
        watches = any(isinstance(each, presence.PresenceWatch) for each in self._declared)
        client = await self._presence_client() if watches else self.zenoh_session
        return await presence.present(client, ignored=self.ignored)

    async def present_sessions(self) -> tuple[list[keys.PresenceKey], bool]:
        """Return the presence keys of operators and monitors, and whether there are no others.

        Raises:
            NoAnswerError: If the router has just gone.
        """
        return await presence.present_sessions(await self._presence_client(), self.ignored)

    async def _presence_client(self) -> zenoh.Session:
        try:
            return await asyncio.to_thread(self.connection, "presence")
        except SessionError as error:
            raise NoAnswerError(str(error)) from None

    def _check(self, act: access_rights.Act, key: keys.Key | str) -> None:
        """Raise an error with the reason if the router would silently reject the act."""
        who = self.principal
        if who is not None and not access_rights.may(who, who.site, act, str(key)):
            raise NoRightError(codes.NO_RIGHT(access_rights.refusal(who, act, str(key))))

    def measure(
        self,
        name: str,
        text: str,
        read: Callable[[], float | Mapping[str, float] | Mapping[tuple[str, ...], float]],
        *,
        labels: tuple[str, ...] = ("robot",),
    ) -> None:
        """Add a number to the health and the metrics of this process; see `Measure`."""
        self.measures.append(Measure(name, text, read, labels))

    def counters(self) -> Counters:
        """Return the counters of everything sent, received and answered so far; on any thread."""
        with self._declared_lock:
            counters = self._closed_counters.copy()
            for each in self._declared:
                counters.add(each)
        return counters

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        """The open subscriptions."""
        return tuple(each for each in self._declared if isinstance(each, Subscription) and not each.closed)

    def _keep(self, declared: _Declared) -> None:
        with self._declared_lock:
            for each in self._declared:
                if each.closed:
                    self._closed_counters.add(each)
            self._declared = [each for each in self._declared if not each.closed] + [declared]

    def connection(self, name: str, *, wait_s: float = 0.0) -> zenoh.Session:
        """Return the connection with a name (`own_link` in the table); empty: the main one. On any thread.

        A flood on one connection does not delay messages on another.

        Args:
            wait_s: How long to wait, blocking, for a router that has just gone [s].

        Raises:
            SessionError: If the connection must be opened and the router has gone.
        """
        main = self.zenoh_session
        if not name:
            return main
        with self._extra_lock:
            deadline = time.monotonic() + wait_s
            while name not in self._extra:
                try:
                    self._extra[name] = forked.open_unshared(self.extra_config)
                except zenoh.ZError as error:
                    if time.monotonic() >= deadline:
                        raise SessionError(f"the router has gone: {first_line(error)}") from None
                    time.sleep(_RETRY_S)
            return self._extra[name]

    async def _refresh(self) -> None:
        async for who, alive in self.watch_presence():
            if alive and who.service not in presence.SILENT:
                for subscription in self.subscriptions:
                    subscription.refresh(who.site, who.robot)

    async def close(self) -> None:
        """Close everything declared, then the session; in a forked process, nothing."""
        if os.getpid() != self._pid:
            return
        if self._refresher is not None:
            self._refresher.cancel()
        for token in self._tokens:
            token.undeclare()
        for declared in self._declared:
            declared.close()
        # Closing waits for Zenoh's threads, which may wait for the event loop.
        await asyncio.to_thread(forked.close_unshared, self._opened)
        for connection in self._extra.values():
            await asyncio.to_thread(forked.close_unshared, connection)
        # An interrupted exit does not wait for threads, and would end Python inside Zenoh's code.
        await asyncio.to_thread(self._join)

    def _join(self) -> None:
        self._answering.close()
        for declared in self._declared:
            if isinstance(declared, Subscription):
                declared.join()


@asynccontextmanager
async def open_session(settings: SessionSettings) -> AsyncIterator[Session]:
    """Open a session with a router; wait for one as long as the settings say.

    Raises:
        SessionError: If an endpoint or the certificate is invalid, or no router answered in time.
    """
    identity, warning = connect_errors.own_certificate(settings.tls)
    if warning:
        log.warning("%s", warning)
    principal = None if identity is None else access_rights.principal_of(identity)
    config = client_config(settings.connect, settings.tls)
    extra_config = client_config(settings.connect, settings.tls, small_buffers=True)
    loop = asyncio.get_running_loop()
    deadline = None if settings.wait_s is None else loop.time() + settings.wait_s
    routers = ", ".join(settings.connect)
    logged, refused = False, connect_errors.refusal_of_routers
    while True:
        try:
            session = Session(await asyncio.to_thread(forked.open_unshared, config), extra_config, principal)
            break
        except zenoh.ZError:
            timed_out = deadline is not None and loop.time() >= deadline
            # With a deadline the error gives the reason; a script would print it twice.
            to_log = deadline is None and not logged
            diagnose = timed_out or (settings.tls is not None and to_log)
            reason = await asyncio.to_thread(refused, settings.connect, settings.tls) if diagnose else None
            if timed_out:
                raise SessionError(
                    reason
                    or f"no router at {routers}: start one (robomesh up, robomesh router) or give "
                    "another address"
                ) from None
            if to_log:
                log.warning("%s", reason or f"no router at {routers} yet: waiting for one")
                logged = True
            await asyncio.sleep(_RETRY_S)
    if logged:
        log.info("router found at %s", routers)
    if settings.tls is not None and identity is not None and identity.expires is not None:
        left_s = partial(connect_errors.left_s, settings.tls.certificate, identity.expires)
        session.measure(CERTIFICATE, "Until this process's certificate expires", left_s)
    try:
        yield session
    finally:
        await session.close()
