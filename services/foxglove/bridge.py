"""The bridge: who is on the mesh becomes channels, and what Foxglove watches is subscribed to."""

import asyncio
import logging
from collections.abc import Callable

import foxglove
from foxglove.websocket import Capability, ChannelView, Client, ServerListener, WebSocketServer

from robomesh.errors import BusError
from robomesh.keys import WHOLE_SITE, PresenceKey, every_robot
from robomesh.presence import SILENT
from robomesh.schemas.robomesh_pb2 import Description
from robomesh.session import Session
from services.foxglove.channels import Channels
from services.foxglove.commands import Commands
from services.foxglove.settings import Settings

log = logging.getLogger(__name__)

_MESH_WITHIN_S = 10.0
# Of a client that reads slowly, the oldest messages are dropped beyond that: a second of states.
_BACKLOG = 256


class Bridge:
    """What is on the mesh, and what of it is shown."""

    def __init__(self, session: Session, settings: Settings) -> None:
        self.session, self.settings = session, settings
        self.context = foxglove.Context()
        self.channels = Channels(session, self.context, one_robot=len(settings.robots) == 1)
        self._loop = asyncio.get_running_loop()
        self._alive: dict[tuple[str, str], set[PresenceKey]] = {}
        self._going: dict[tuple[str, str], asyncio.TimerHandle] = {}
        self._server: WebSocketServer | None = None
        self._commands: Commands | None = None
        self._offered: dict[tuple[str, str], list[str]] = {}

    def start(self, host: str, *, name: str, commands: Commands | None) -> WebSocketServer:
        """The SDK's server, on a free port; what it calls comes on threads of its own.

        Args:
            commands: What clients may ask for; None: nothing.
        """
        self._commands = commands
        self._server = foxglove.start_server(
            name=name,
            host=host,
            port=0,
            capabilities=[Capability.Services] if commands else [],
            supported_encodings=["json"] if commands else None,
            server_listener=_Listener(self._joined, self._left, self._loop),
            asset_handler=self._asset,
            context=self.context,
            message_backlog_size=_BACKLOG,
        )
        return self._server

    async def follow_presence(self) -> None:
        """Robots and sites that come and go, until cancelled."""
        async for who, alive in self.session.watch_presence():
            place = who.site, who.robot
            if who.service in SILENT or not self._shown(*place):
                continue
            there = self._alive.setdefault(place, set())
            (there.add if alive else there.discard)(who)
            try:
                if there:
                    self._came(*place)
                elif place not in self._going:
                    self._going[place] = self._loop.call_later(self.settings.gone_after_s, self._gone, *place)
            except BusError as error:
                log.debug("%s: %s", who, error)

    async def follow_descriptions(self) -> None:
        """What robots are, until cancelled."""
        async for sample in self.session.subscribe(every_robot("description"), newest=1000):
            place = sample.parsed.site, sample.parsed.robot
            try:
                description = sample.message()
                assert isinstance(description, Description)
                if self._shown(*place):
                    self._came(*place)
                    self.channels.describe(*place, description)
            except BusError as error:
                log.warning("%s: %s", sample.key, error)

    def _shown(self, site: str, robot: str) -> bool:
        return robot == WHOLE_SITE or self.settings.wants(site, robot)

    def _came(self, site: str, robot: str) -> None:
        if (going := self._going.pop((site, robot), None)) is not None:
            going.cancel()
        self.channels.add(site, robot)
        if self._commands and self._server and robot != WHOLE_SITE and (site, robot) not in self._offered:
            services = self._commands.of(site, robot)
            self._offered[site, robot] = [service.name for service in services]
            self._server.add_services(services)

    def _gone(self, site: str, robot: str) -> None:
        self._going.pop((site, robot), None)
        self.channels.drop(site, robot)
        if self._server and (offered := self._offered.pop((site, robot), None)):
            self._server.remove_services(offered)

    def _joined(self, client: int, name: str) -> None:
        if (lane := self.channels.lanes.get(name)) is not None:
            lane.join(client)

    def _left(self, client: int, name: str) -> None:
        if (lane := self.channels.lanes.get(name)) is not None:
            lane.leave(client)

    def _asset(self, uri: str) -> bytes | None:
        """On a thread of the SDK's: a file that a description names."""
        return asyncio.run_coroutine_threadsafe(self._mesh(uri), self._loop).result()

    async def _mesh(self, uri: str) -> bytes | None:
        key = self.channels.asset_key(uri)
        return None if key is None else await self.session.ask_bytes(key, timeout_s=_MESH_WITHIN_S)


class _Listener(ServerListener):
    """Hands over what the SDK tells of its clients to the event loop."""

    def __init__(
        self,
        joined: Callable[[int, str], None],
        left: Callable[[int, str], None],
        loop: asyncio.AbstractEventLoop,
    ) -> None:
        self._of = {True: joined, False: left}
        self._loop = loop

    def _hand_over(self, client: Client, channel: ChannelView, *, watches: bool) -> None:
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._of[watches], client.id, channel.topic)

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:
        """A client watches a channel."""
        self._hand_over(client, channel, watches=True)

    def on_unsubscribe(self, client: Client, channel: ChannelView) -> None:
        """It watches it no more, or is gone."""
        self._hand_over(client, channel, watches=False)
