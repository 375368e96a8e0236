"""A wire between a gateway and a simulated controller: cut, swallowing, keeping back, delaying, doubling."""

import asyncio
import contextlib
import itertools


class Wire:
    """A relay of one port, TCP or UDP.

    Attributes:
        port: The gateway connects here.
        sent: Bytes that the gateway sent, in the parts in which they arrived; datagrams are whole.
        swallows: Connections stay open, but nothing arrives at either side.
        commands: Function that returns the datagrams to send in place of one of the gateway.
        answers: The same for a datagram of the controller, or for what of its bytes arrives together.
        delays: Endless delays of the datagrams, one after the other [s], so that they overtake each other.
    """

    def __init__(self, target, *, datagrams=False):
        self.target, self._datagrams = target, datagrams
        self.port = 0
        self.sent = []
        self.swallows = False
        self.commands = self.answers = lambda data: [data]
        self.delays = itertools.repeat(0.0)
        self._keeps = None
        self._kept = []
        self._ends = set()  # what is closed when the wire is cut
        self._listening = None

    @property
    def data(self):
        """All bytes that the gateway sent."""
        return b"".join(self.sent)

    async def open(self):
        """Listen, at the same port as before."""
        loop = asyncio.get_running_loop()
        if self._datagrams:
            self._listening, _ = await loop.create_datagram_endpoint(
                lambda: _Gateway(self), local_addr=("127.0.0.1", self.port)
            )
            self.port = self._listening.get_extra_info("sockname")[1]
            return
        self._listening = await asyncio.start_server(self._join, "127.0.0.1", self.port)
        self.port = self._listening.sockets[0].getsockname()[1]

    def cut(self):
        """End all connections and refuse new ones until `open`."""
        self._listening.close()
        for each in [*self._ends]:
            each.abort()
        self._ends.clear()

    async def lead_to(self, target):
        """End all connections; new ones go to another port."""
        self.cut()
        self.target, self.swallows = target, False
        await asyncio.sleep(0)
        await self.open()

    def keep_back(self, which=lambda data: True):
        """Keep what the gateway sends until `release`: datagrams of a kind, or all bytes after the first."""
        self._keeps = which

    def release(self):
        """Send what was kept back, in its order."""
        self._keeps, kept, self._kept = None, self._kept, []
        for send, data in kept:
            send(data)

    def pass_on(self, data, send):
        """Send bytes of the gateway to the controller, now or later."""
        if self._keeps is not None and (self._keeps(data) or (self._kept and not self._datagrams)):
            self._kept.append((send, data))
        else:
            self.later(send, data)

    def later(self, send, data):
        """Send after the next delay."""
        delay_s = next(self.delays)
        asyncio.get_running_loop().call_later(delay_s, send, data) if delay_s else send(data)

    async def _join(self, reader, writer):
        self._ends.add(writer.transport)
        try:
            there, back = await asyncio.open_connection("127.0.0.1", self.target)
        except OSError:
            writer.transport.abort()
            return
        self._ends.add(back.transport)
        await asyncio.gather(
            self._forward(reader, back, self.sent, lambda data: self.pass_on(data, back.write)),
            self._forward(there, writer, [], lambda data: writer.writelines(self.answers(data))),
        )

    async def _forward(self, reader, writer, seen, send):
        swallowed = False
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                seen.append(data)
                # A stream with a gap is of no use: it carries nothing any more, also after the fault.
                swallowed = swallowed or self.swallows
                if not swallowed:
                    send(data)
        writer.transport.abort()


class _Gateway(asyncio.DatagramProtocol):
    """Datagrams of the gateway; each of its sockets has its own towards the controller."""

    def __init__(self, wire):
        self.wire, self.backs = wire, {}

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, address):
        self.wire.sent.append(data)
        if address not in self.backs:
            self.backs[address] = asyncio.ensure_future(self._back(address))
        self.backs[address].add_done_callback(lambda back: self._send(back, data))

    async def _back(self, address):
        loop = asyncio.get_running_loop()
        back, _ = await loop.create_datagram_endpoint(
            lambda: _Controller(self, address), remote_addr=("127.0.0.1", self.wire.target)
        )
        self.wire._ends.add(back)
        return back

    def _send(self, back, data):
        if not self.wire.swallows and not back.cancelled() and back.exception() is None:
            for each in self.wire.commands(data):
                self.wire.pass_on(each, back.result().sendto)


class _Controller(asyncio.DatagramProtocol):
    def __init__(self, gateway, address):
        self.gateway, self.address = gateway, address

    def datagram_received(self, data, _):
        if not self.gateway.wire.swallows:
            for each in self.gateway.wire.answers(data):
                self.gateway.wire.later(self._send, each)

    def _send(self, data):
        self.gateway.transport.sendto(data, self.address)


@contextlib.asynccontextmanager
async def wire(target, **options):
    """Open a wire to a port; yield it."""
    relay = Wire(target, **options)
    await relay.open()
    try:
        yield relay
    finally:
        relay.cut()
