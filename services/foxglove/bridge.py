"""Bridge between the mesh and the SDK's server: robots become channels, subscribed to while clients watch."""

import asyncio
import logging
from collections.abc import Callable

import foxglove
from foxglove.websocket import Capability, ChannelView, Client, ServerListener, WebSocketServer

from robomesh.contract.keys import WHOLE_SITE, PresenceKey, every_robot
from robomesh.errors import RobomeshError
from robomesh.schemas.robomesh_pb2 import Description
from robomesh.wire.presence import SILENT
from robomesh.wire.session import Session
from services.foxglove.channels import Channels
from services.foxglove.commands import Commands
from services.foxglove.settings import Settings

log = logging.getLogger(__name__)

_SHAPE_TIMEOUT_S = 10.0
# Queue size of a slow client, about a second of states; beyond it the oldest messages are dropped.
_BACKLOG = 256


class Bridge:
    """Channels and services for the robots on the mesh that the settings select."""

    def __init__(self, session: Session, settings: Settings) -> None:
        self.session, self.settings = session, settings
        self.context = foxglove.Context()
        self.channels = Channels(session, self.context)
        self._loop = asyncio.get_running_loop()
        self._alive: dict[tuple[str, str], set[PresenceKey]] = {}
        self._removals: dict[tuple[str, str], asyncio.TimerHandle] = {}
        self._server: WebSocketServer | None = None
        self._commands: Commands | None = None
        self._offered: dict[tuple[str, str], list[str]] = {}

    def start(self, host: str, *, name: str, commands: Commands | None) -> WebSocketServer:
        """Start the SDK's server on a free port and return it; its callbacks run on the SDK's threads.

        Args:
            commands: Services to offer; None for none.
        """
        self._commands = commands
        self._server = foxglove.start_server(
            name=name,
            host=host,
            port=0,
            capabilities=[Capability.Services] if commands else [],
            supported_encodings=["json"] if commands else None,
            server_listener=_SubscriptionListener(self._on_join, self._on_leave, self._loop),
            asset_handler=self._asset,
            context=self.context,
            message_backlog_size=_BACKLOG,
        )
        return self._server

    async def follow_presence(self) -> None:
        """Add and remove robots and sites as their services come online and go offline, until cancelled."""
        async for presence, alive in self.session.watch_presence():
            robot = presence.site, presence.robot
            if presence.service in SILENT or not self._is_shown(*robot):
                continue
            services = self._alive.setdefault(robot, set())
            (services.add if alive else services.discard)(presence)
            try:
                if services:
                    self._add(*robot)
                elif robot not in self._removals:
                    self._removals[robot] = self._loop.call_later(
                        self.settings.gone_after_s, self._remove, *robot
                    )
            except RobomeshError as error:
                log.debug("%s: %s", presence, error)

    async def follow_descriptions(self) -> None:
        """Receive the robots' descriptions until cancelled."""
        async for sample in self.session.subscribe(every_robot("description"), newest=1000):
            robot = sample.parsed.site, sample.parsed.robot
            try:
                description = sample.message()
                assert isinstance(description, Description)
                if self._is_shown(*robot):
                    self._add(*robot)
                    self.channels.describe(*robot, description)
            except RobomeshError as error:
                log.warning("%s: %s", sample.key, error)

    def _is_shown(self, site: str, robot: str) -> bool:
        return robot == WHOLE_SITE or self.settings.wants(site, robot)

    def _add(self, site: str, robot: str) -> None:
        if (removal := self._removals.pop((site, robot), None)) is not None:
            removal.cancel()
        self.channels.add(site, robot)
        if self._commands and self._server and robot != WHOLE_SITE and (site, robot) not in self._offered:
            services = self._commands.of(site, robot)
            self._offered[site, robot] = [service.name for service in services]
            self._server.add_services(services)

    def _remove(self, site: str, robot: str) -> None:
        self._removals.pop((site, robot), None)
        self.channels.drop(site, robot)
        if self._server and (offered := self._offered.pop((site, robot), None)):
            self._server.remove_services(offered)

    def _on_join(self, client: int, name: str) -> None:
        if (channel := self.channels.topic_channels.get(name)) is not None:
            channel.join(client)

    def _on_leave(self, client: int, name: str) -> None:
        if (channel := self.channels.topic_channels.get(name)) is not None:
            channel.leave(client)

    def _asset(self, uri: str) -> bytes | None:
        """Return a file that a description names; called on a thread of the SDK."""
        return asyncio.run_coroutine_threadsafe(self._shape(uri), self._loop).result()

    async def _shape(self, uri: str) -> bytes | None:
        key = self.channels.asset_key(uri)
        return None if key is None else await self.session.ask_bytes(key, timeout_s=_SHAPE_TIMEOUT_S)


class _SubscriptionListener(ServerListener):
    """Forwards the SDK's subscription callbacks to the event loop."""

    def __init__(
        self,
        joined: Callable[[int, str], None],
        left: Callable[[int, str], None],
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        self._callbacks = {True: joined, False: left}
        self._loop = loop

    def _forward(self, client: Client, channel: ChannelView, *, watches: bool) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._callbacks[watches], client.id, channel.topic)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """Forward that a client subscribed to a channel."""
        self._forward(client, channel, watches=True)

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """Forward that a client unsubscribed or disconnected."""
        self._forward(client, channel, watches=False)
