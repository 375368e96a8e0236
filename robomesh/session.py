"""A session on the mesh: a client of a router, with everything declared on it."""

import asyncio
import logging
import secrets
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from functools import partial

import zenoh
from google.protobuf.message import Message

from robomesh import access, client, connect_errors, keys, presence, server, topics
from robomesh import reason_codes as codes
from robomesh.counters import Measure, Tally
from robomesh.endpoints import DEFAULT_ROUTER, Tls, client_config, first_line
from robomesh.errors import BrokenAnswerError, NoAnswerError, NoRightError, SessionError
from robomesh.ignored import REPLY, Ignored
from robomesh.publisher import OnGet, Publisher
from robomesh.request_queue import Turns
from robomesh.subscription import Subscription

log = logging.getLogger(__name__)

_RETRY_S = 0.25
# A measure of whoever has one [s].
CERTIFICATE = "certificate_seconds"

_Declared = Publisher | Subscription | server.Answerer | presence.PresenceWatch


@dataclass(frozen=True, kw_only=True)
class SessionSettings:
    """Which routers to try, in order, and the certificates to show them.

    Attributes:
        wait_s: How long to wait for a router at the start; None: for ever, saying so.
    """

    connect: tuple[str, ...] = (DEFAULT_ROUTER,)
    tls: Tls | None = None
    wait_s: float | None = None


@dataclass
class Session:
    """An open session. What is declared on it ends with it."""

    zenoh_session: zenoh.Session
    # Of its further connections.
    config_apart: zenoh.Config
    # Who it is by its certificate; None: it has none, or one that does not say.
    principal: access.Principal | None = None
    # This process, in presence keys.
    identity: str = field(default_factory=lambda: secrets.token_hex(4))
    # Numbers of the service's own, for who looks after it.
    measures: list[Measure] = field(default_factory=list)
    # Keys that fit no key of the contract.
    ignored: Ignored = field(default_factory=Ignored)
    _declared: list[_Declared] = field(default_factory=list)
    _ended: Tally = field(default_factory=Tally)
    _keeping: threading.Lock = field(default_factory=threading.Lock)
    _tokens: list[zenoh.LivelinessToken] = field(default_factory=list)
    _refresher: asyncio.Task[None] | None = None
    # In which all that it answers begins.
    _turns: Turns | None = None
    # Further connections, by the names that rows of the table give them.
    _apart: dict[str, zenoh.Session] = field(default_factory=dict)
    _opening: threading.Lock = field(default_factory=threading.Lock)

    @property
    def connected(self) -> bool:
        """Whether a router is there now."""
        return bool(self.zenoh_session.info.routers_zid())

    @property
    def own_name(self) -> str:
        """In whose name it asks: its certificate's; without one any name goes, and it is this process's."""
        return self.identity if self.principal is None else self.principal.name

    def declare_publisher(
        self, site: str, robot: str, topic: str, *, on_get: OnGet | None = None
    ) -> Publisher:
        """Publish a topic of the table; `on_get` answers late joiners instead of the last value.

        Raises:
            NoRightError: If this session's certificate may not.
        """
        self._check("put", keys.robot_key(site, robot, topic))
        publisher = Publisher(self.zenoh_session, site, robot, topic, on_get=on_get)
        self._keep(publisher)
        return publisher

    def subscribe(self, key_expr: str, *, newest: int = 1, history: bool = True) -> Subscription:
        """Listen to a topic, of one robot or by wildcard of many.

        Args:
            newest: How many samples wait for a slow consumer, in all; older ones are dropped.
            history: Begin with the last value, and ask for it again when a service comes back.
        """
        subscription = Subscription(
            self.zenoh_session, key_expr, newest=newest, history=history, ignored=self.ignored
        )
        self._keep(subscription)
        if history and self._refresher is None:
            self._refresher = asyncio.create_task(self._refresh())
        return subscription

    async def ask(self, key: str, request: Message | None = None, *, timeout_s: float = 2.0) -> Message:
        """The answer to a request.

        Raises:
            NoRightError: If this session's certificate may not ask it.
            RefusedError: With the owner's words.
            NoAnswerError: If nobody answered in time.
        """
        payload = b"" if request is None else request.SerializeToString()
        return client.decode_answer(key, await self.ask_bytes(key, payload, timeout_s=timeout_s))

    async def ask_bytes(self, key: str, payload: bytes = b"", *, timeout_s: float = 2.0) -> bytes:
        """As `ask`, with bytes both ways."""
        self._check("query", key)
        try:
            return await client.ask_bytes(self.zenoh_session, key, payload, timeout_s=timeout_s)
        except NoAnswerError as error:
            if self.principal is None or isinstance(error, BrokenAnswerError):
                raise
            # A router refuses in silence.
            raise NoAnswerError(f"{error} Or was the certificate of {self.principal.name} revoked?") from None

    async def ask_all(
        self, key: str, request: Message | None = None, *, timeout_s: float = 2.0
    ) -> list[client.Answer]:
        """Every owner's answer to a request on a key with a wildcard."""
        self._check("query", key)
        payload = b"" if request is None else request.SerializeToString()
        answers = await client.ask_all(self.zenoh_session, key, payload, timeout_s=timeout_s)
        # Of a refusal the key that was asked is known, and no owner's.
        fits = (each for each in answers if each[0] == key or self.ignored.key(REPLY, each[0]) is not None)
        return [client.answer_of(*each) for each in fits]

    async def last(self, key: str, *, timeout_s: float = 2.0) -> Message | None:
        """The last value of a topic (its history message where it has one); None: nobody has one."""
        subscription = Subscription(self.zenoh_session, key, newest=1, history=True, ignored=self.ignored)
        try:
            async with asyncio.timeout(timeout_s):
                while True:
                    sample = await anext(subscription)
                    # Of a list topic the list is asked for, not what comes meanwhile.
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
        on_refused: server.OnRefused = lambda chunk, text: None,
    ) -> server.Answerer:
        """Answer a request of the table: `stop`, `command/*`; `on_refused` is told of what cannot be read.

        Raises:
            NoRightError: If this session's certificate may not.
            SessionError: If it is answered over a link of its own, and the router has just gone.
        """
        self._check("declare_queryable", keys.robot_key(site, robot, name))
        over = self.connection(topics.request(name).own_link)
        if self._turns is None:
            self._turns = Turns()
        answerer = server.Answerer(
            over,
            site,
            robot,
            name,
            handler,
            turns=self._turns,
            on_refused=on_refused,
            ignored=self.ignored,
        )
        self._keep(answerer)
        return answerer

    def declare_presence(self, site: str, robot: str, service: str) -> None:
        """Say that a service is alive for a robot (`-`: for the whole site)."""
        key = keys.presence_key(site, robot, service, self.identity)
        self._tokens.append(self.zenoh_session.liveliness().declare_token(key))

    def declare_presence_of(
        self, site: str, robot: str, service: str, identity: str
    ) -> zenoh.LivelinessToken:
        """As `declare_presence`, for somebody whom this process speaks for, until it is undeclared."""
        key = keys.presence_key(site, robot, service, identity)
        return self.zenoh_session.liveliness().declare_token(key)

    def watch_presence(self, key_expr: str = presence.EVERYBODY) -> presence.PresenceWatch:
        """Who comes alive and who goes; who is there already comes first."""
        watch = presence.PresenceWatch(self.zenoh_session, key_expr, self.ignored)
        self._keep(watch)
        return watch

    async def present(self) -> list[keys.PresenceKey]:
        """Who is alive now, everywhere, sorted.

        Raises:
            NoAnswerError: If the router did not tell all in time.
        """
        # To a session that watches presence too, Zenoh leaves out tokens in 1 to 5 of 100 answers.
        watches = any(isinstance(each, presence.PresenceWatch) for each in self._declared)
        try:
            client = await asyncio.to_thread(self.connection, "presence" if watches else "")
        except SessionError as error:
            raise NoAnswerError(str(error)) from None
        return await presence.present(client, ignored=self.ignored)

    def _check(self, act: access.Act, key: str) -> None:
        """Say at once, and in words, what the router would refuse in silence."""
        who = self.principal
        if who is not None and not access.may(who, who.site, act, key):
            raise NoRightError(codes.NO_RIGHT(detail=access.refusal(who, act, key)))

    def measure(self, name: str, text: str, read: Callable[[], float | Mapping[str, float]]) -> None:
        """Tell a number of the service's own in its health and its metrics; see `Measure`."""
        self.measures.append(Measure(name, text, read))

    def tally(self) -> Tally:
        """What was sent, received and answered until now; on any thread."""
        with self._keeping:
            tally = self._ended.copy()
            for each in self._declared:
                tally.add(each)
        return tally

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        """Those that are open."""
        return tuple(each for each in self._declared if isinstance(each, Subscription) and not each.closed)

    def _keep(self, declared: _Declared) -> None:
        with self._keeping:
            for each in self._declared:
                if each.closed:
                    self._ended.add(each)
            self._declared = [each for each in self._declared if not each.closed] + [declared]

    def connection(self, name: str) -> zenoh.Session:
        """The connection of a name (`own_link` of the table); empty: the one for everything. On any thread.

        What comes over one waits behind nothing that floods another.

        Raises:
            SessionError: If it has to be opened, and the router has just gone.
        """
        if not name:
            return self.zenoh_session
        with self._opening:
            if name not in self._apart:
                try:
                    self._apart[name] = zenoh.open(self.config_apart)
                except zenoh.ZError as error:
                    raise SessionError(f"the router has gone: {first_line(error)}") from None
            return self._apart[name]

    async def _refresh(self) -> None:
        async for who, alive in self.watch_presence():
            if alive and who.service not in presence.SILENT:
                for subscription in self.subscriptions:
                    subscription.refresh(who.site, who.robot)

    async def close(self) -> None:
        """End everything declared, then the session."""
        if self._refresher is not None:
            self._refresher.cancel()
        for token in self._tokens:
            token.undeclare()
        for declared in self._declared:
            declared.close()
        # Closing waits for Zenoh's threads, which may wait for the loop.
        await asyncio.to_thread(self.zenoh_session.close)
        for apart in self._apart.values():
            await asyncio.to_thread(apart.close)


@asynccontextmanager
async def open_session(settings: SessionSettings) -> AsyncIterator[Session]:
    """A session with a router, waiting for one as long as the settings say.

    Raises:
        SessionError: If an endpoint is wrong, the certificate is not good, or no router came in time.
    """
    identity, warning = connect_errors.own_certificate(settings.tls)
    if warning:
        log.warning("%s", warning)
    principal = None if identity is None else access.principal_of(identity)
    config = client_config(settings.connect, settings.tls)
    config_apart = client_config(settings.connect, settings.tls, holds_little=True)
    loop = asyncio.get_running_loop()
    deadline = None if settings.wait_s is None else loop.time() + settings.wait_s
    routers = ", ".join(settings.connect)
    told = False
    while True:
        try:
            session = Session(await asyncio.to_thread(zenoh.open, config), config_apart, principal)
            break
        except zenoh.ZError:
            last = deadline is not None and loop.time() >= deadline
            looked = last or (settings.tls is not None and not told)
            reason = await asyncio.to_thread(_refusal, settings) if looked else None
            if last:
                raise SessionError(
                    reason
                    or f"no router at {routers}: start one (robomesh up, robomesh router) or name another "
                    "with --connect"
                ) from None
            if not told:
                log.warning("%s", reason or f"no router at {routers} yet: waiting for one")
                told = True
            await asyncio.sleep(_RETRY_S)
    if told:
        log.info("router found at %s", routers)
    if settings.tls is not None and identity is not None and identity.expires is not None:
        left_s = partial(connect_errors.left_s, settings.tls.certificate, identity.expires)
        session.measure(CERTIFICATE, "Until the own certificate expires", left_s)
    try:
        yield session
    finally:
        await session.close()


def _refusal(settings: SessionSettings) -> str | None:
    """Why the first router that is there does not let us in."""
    return next(
        (reason for each in settings.connect if (reason := connect_errors.why(each, settings.tls))), None
    )
