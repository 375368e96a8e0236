"""Old client program for the gateway's tests: a plain socket, like the paper's programs."""

import asyncio
import contextlib

from protocol_gateway.legacy.settings import LegacySettings
from protocol_gateway.unit_protocol.records import AbsolutePositions, Error, Status
from protocol_gateway.unit_protocol.stream import Malformed, UnitStream
from tests.ports import free_port
from tests.protocol_gateway.gateway_site import gateway, simulator, until

ME = "127.0.0.1"


def legacy(**settings):
    """Return settings for old client programs; programs of this machine command as li."""
    return LegacySettings(**{"host": ME, "port": free_port(), "commanders": {ME: "li"}, **settings})


class Program:
    """Old client program that keeps the bytes and units that it reads."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer
        self.bytes, self.events, self._stream = b"", [], UnitStream()
        self.ended = False
        self._task = asyncio.create_task(self._read())

    async def _read(self):
        with contextlib.suppress(OSError):
            while data := await self.reader.read(4096):
                self.bytes += data
                self.events += self._stream.receive(data)
        self.ended = True

    @property
    def units(self):
        assert not [event for event in self.events if isinstance(event, Malformed)]
        return self.events

    @property
    def positions(self):
        return [r.values for unit in self.units for r in unit.records if isinstance(r, AbsolutePositions)]

    @property
    def words(self):
        found = [r.words for unit in self.units for r in unit.records if isinstance(r, Status)]
        return found[-1] if found else ()

    @property
    def errors(self):
        return [r for unit in self.units for r in unit.records if isinstance(r, Error)]

    @property
    def last_state(self):
        """Bytes of the last unit with positions; a refusal may have followed."""
        return [unit for unit in self.bytes.split(b"@")[:-1] if b"ABSOLUTE" in unit][-1] + b"@"

    def say(self, *units):
        self.writer.write(b"".join(units))

    async def asks(self, *units):
        seen = len(self.errors)
        self.say(*units)
        await until(lambda: len(self.errors) > seen)
        return self.errors[seen].number, self.errors[seen].text

    async def close(self):
        self.writer.close()
        with contextlib.suppress(OSError):
            await self.writer.wait_closed()
        await self._task


@contextlib.asynccontextmanager
async def program(settings):
    reader, writer = await asyncio.open_connection(ME, settings.port)
    one = Program(reader, writer)
    try:
        yield one
    finally:
        await one.close()


@contextlib.asynccontextmanager
async def legacy_site(mesh, folder, settings, **robot):
    """Run a gateway with a simulated controller that accepts old client programs."""
    async with (
        simulator(**robot.pop("simulated", {})) as port,
        gateway(mesh, folder, port, legacy_clients=settings, **robot) as site,
    ):
        yield site
