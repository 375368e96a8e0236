"""UDP relay between a gateway and a controller that keeps what the gateway sends, and may change answers."""

import asyncio
import contextlib


class _There(asyncio.DatagramProtocol):
    def __init__(self, tap):
        self.tap = tap

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, address):
        for answer in self.tap.change(data):
            self.tap.transport.sendto(answer, self.tap.client)

    def error_received(self, error):
        pass


class Tap(asyncio.DatagramProtocol):
    """The relay.

    Attributes:
        sent: Datagrams of the gateway.
        change: Returns the datagrams to pass on in place of an answer.
    """

    def __init__(self):
        self.sent = []
        self.change = lambda answer: [answer]
        self.client = None

    def connection_made(self, transport):
        self.transport = transport

    def datagram_received(self, data, address):
        self.sent.append(data)
        self.client = address
        self.there.sendto(data)


@contextlib.asynccontextmanager
async def tap(port):
    """Forward datagrams to a port; yield the tap and its own port."""
    loop = asyncio.get_running_loop()
    here, relay = await loop.create_datagram_endpoint(Tap, local_addr=("127.0.0.1", 0))
    there, _ = await loop.create_datagram_endpoint(lambda: _There(relay), remote_addr=("127.0.0.1", port))
    relay.there = there
    try:
        yield relay, here.get_extra_info("sockname")[1]
    finally:
        here.abort()
        there.abort()
