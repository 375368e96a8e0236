"""A session on the mesh: a client of a router, with everything declared on it."""

import asyncio
import logging
import secrets
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

import zenoh
from google.protobuf.message import Message

from bus import keys, presence, requests
from bus.endpoints import DEFAULT_ROUTER, Tls, client_config
from bus.errors import SessionError
from bus.publisher import OnGet, Publisher
from bus.subscription import Subscription

log = logging.getLogger(__name__)

_RETRY_S = 0.25


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
    # This process, in presence keys.
    identity: str = field(default_factory=lambda: secrets.token_hex(4))
    _subscriptions: list[Subscription] = field(default_factory=list)
    _declared: list[Publisher | requests.Answerer | presence.PresenceWatch] = field(default_factory=list)
    _tokens: list[zenoh.LivelinessToken] = field(default_factory=list)
    _refresher: asyncio.Task[None] | None = None

    @property
    def connected(self) -> bool:
        """Whether a router is there now."""
        return bool(self.zenoh_session.info.routers_zid())

    def declare_publisher(
        self, site: str, robot: str, topic: str, *, on_get: OnGet | None = None
    ) -> Publisher:
        """Publish a topic of the table; `on_get` answers late joiners instead of the last value."""
        publisher = Publisher(self.zenoh_session, site, robot, topic, on_get=on_get)
        self._declared.append(publisher)
        return publisher

    def subscribe(self, key_expr: str, *, newest: int = 1, history: bool = True) -> Subscription:
        """Listen to a topic, of one robot or by wildcard of many.

        Args:
            newest: How many samples wait for a slow consumer, in all; older ones are dropped.
            history: Begin with the last value, and ask for it again when a service comes back.
        """
        subscription = Subscription(self.zenoh_session, key_expr, newest=newest, history=history)
        if history:
            self._subscriptions.append(subscription)
            if self._refresher is None:
                self._refresher = asyncio.create_task(self._refresh())
        return subscription

    async def ask(self, key: str, request: Message | None = None, *, timeout_s: float = 2.0) -> Message:
        """The answer to a request.

        Raises:
            RefusedError: With the owner's words.
            NoAnswerError: If nobody answered in time.
        """
        payload = b"" if request is None else request.SerializeToString()
        return requests.decode_answer(key, await self.ask_bytes(key, payload, timeout_s=timeout_s))

    async def ask_bytes(self, key: str, payload: bytes = b"", *, timeout_s: float = 2.0) -> bytes:
        """As `ask`, with bytes both ways."""
        return await requests.ask_bytes(self.zenoh_session, key, payload, timeout_s=timeout_s)

    async def ask_all(
        self, key: str, request: Message | None = None, *, timeout_s: float = 2.0
    ) -> list[requests.Answer]:
        """Every owner's answer to a request on a key with a wildcard."""
        payload = b"" if request is None else request.SerializeToString()
        answers = await requests.ask_all(self.zenoh_session, key, payload, timeout_s=timeout_s)
        return [
            requests.Answer(owner, None if answer is None else requests.decode_answer(owner, answer), error)
            for owner, answer, error in answers
        ]

    async def last(self, key: str, *, timeout_s: float = 2.0) -> Message | None:
        """The last value of a topic (its history message where it has one); None: nobody has one."""
        subscription = Subscription(self.zenoh_session, key, newest=1, history=True)
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

    def answer(self, site: str, robot: str, name: str, handler: requests.Handler) -> requests.Answerer:
        """Answer a request of the table: `stop`, `command/*`."""
        answerer = requests.Answerer(self.zenoh_session, site, robot, name, handler)
        self._declared.append(answerer)
        return answerer

    def declare_presence(self, site: str, robot: str, service: str) -> None:
        """Say that a service is alive for a robot (`-`: for the whole site)."""
        key = keys.presence_key(site, robot, service, self.identity)
        self._tokens.append(self.zenoh_session.liveliness().declare_token(key))

    def watch_presence(self, key_expr: str = presence.EVERYBODY) -> presence.PresenceWatch:
        """Who comes alive and who goes; who is there already comes first."""
        watch = presence.PresenceWatch(self.zenoh_session, key_expr)
        self._declared.append(watch)
        return watch

    async def present(self) -> list[keys.PresenceKey]:
        """Who is alive now, everywhere, sorted."""
        return await presence.present(self.zenoh_session)

    async def _refresh(self) -> None:
        async for who, alive in self.watch_presence():
            self._subscriptions = [each for each in self._subscriptions if not each.closed]
            if alive:
                for subscription in self._subscriptions:
                    subscription.refresh(who.site, who.robot)

    async def close(self) -> None:
        """End everything declared, then the session."""
        if self._refresher is not None:
            self._refresher.cancel()
        for token in self._tokens:
            token.undeclare()
        for subscription in self._subscriptions:
            subscription.close()
        for declared in self._declared:
            declared.close()
        # Closing waits for Zenoh's threads, which may wait for the loop.
        await asyncio.to_thread(self.zenoh_session.close)


@asynccontextmanager
async def open_session(settings: SessionSettings) -> AsyncIterator[Session]:
    """A session with a router, waiting for one as long as the settings say.

    Raises:
        SessionError: If an endpoint is wrong, or no router came in time.
    """
    config = client_config(settings.connect, settings.tls)
    loop = asyncio.get_running_loop()
    deadline = None if settings.wait_s is None else loop.time() + settings.wait_s
    routers = ", ".join(settings.connect)
    told = False
    while True:
        try:
            session = Session(await asyncio.to_thread(zenoh.open, config))
            break
        except zenoh.ZError:
            if deadline is not None and loop.time() >= deadline:
                raise SessionError(
                    f"no router at {routers}: start one (robomesh up, robomesh router) or name another "
                    "with --connect"
                ) from None
            if not told:
                log.warning("no router at %s yet: waiting for one", routers)
                told = True
            await asyncio.sleep(_RETRY_S)
    if told:
        log.info("router found at %s", routers)
    try:
        yield session
    finally:
        await session.close()
