"""Client of Foxglove's WebSocket protocol, written from its specification and independent of robomesh."""

import asyncio
import json
import struct
from contextlib import asynccontextmanager, suppress

import websockets

MESSAGE, SERVICE_ANSWER, ASSET = 1, 3, 4


class Client:
    """State of one client, and its requests."""

    def __init__(self, websocket):
        self.channels, self.services, self.gone = {}, {}, set()
        self.got = {}  # topic: [(log time, payload)]
        self.info = {}
        self._websocket = websocket
        self._topics, self._answers, self._number = {}, {}, 0

    async def read(self):
        with suppress(websockets.ConnectionClosed):
            async for message in self._websocket:
                (self._text if isinstance(message, str) else self._binary)(message)

    def _text(self, message):
        content = json.loads(message)
        match content["op"]:
            case "serverInfo":
                self.info = content
            case "advertise":
                self.channels |= {channel["topic"]: channel for channel in content["channels"]}
            case "unadvertise":
                self.gone |= set(content["channelIds"])
            case "advertiseServices":
                self.services |= {service["name"]: service for service in content["services"]}
            case "serviceCallFailure":
                self._answers.pop(content["callId"]).set_exception(RuntimeError(content["message"]))

    def _binary(self, message):
        match message[0]:
            case 1:
                _, subscription, time_ns = struct.unpack_from("<BIQ", message)
                self.got[self._topics[subscription]].append((time_ns, message[13:]))
            case 3:
                _, _, call, length = struct.unpack_from("<BIII", message)
                self._answers.pop(call).set_result(json.loads(message[13 + length :]))
            case 4:
                _, request, status, length = struct.unpack_from("<BIBI", message)
                text, data = message[10 : 10 + length], message[10 + length :]
                self._answers.pop(request).set_result(data if status == 0 else RuntimeError(text.decode()))

    def stop_reading(self):
        """Stop reading from the socket."""
        self._websocket.transport.pause_reading()

    async def until(self, condition, timeout_s=30.0):
        async with asyncio.timeout(timeout_s):
            while not (result := condition()):
                await asyncio.sleep(0.01)
        return result

    async def subscribe(self, topic):
        """Subscribe to a topic once it is advertised."""
        await self.until(lambda: topic in self.channels)
        self._number += 1
        self._topics[self._number] = topic
        self.got.setdefault(topic, [])
        wanted = {"id": self._number, "channelId": self.channels[topic]["id"]}
        await self._websocket.send(json.dumps({"op": "subscribe", "subscriptions": [wanted]}))
        return self._number

    async def unsubscribe(self, number):
        await self._websocket.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [number]}))

    async def first(self, topic, schema=None):
        """Return the first message of a subscribed topic."""
        await self.until(lambda: self.got[topic])
        payload = self.got[topic][0][1]
        return payload if schema is None else schema.FromString(payload)

    async def call(self, service, **values):
        """Call a service in JSON and return its answer."""
        await self.until(lambda: service in self.services)
        number, answer = self._waiting()
        head = struct.pack("<BIII", 2, self.services[service]["id"], number, 4) + b"json"
        await self._websocket.send(head + json.dumps(values).encode())
        return await asyncio.wait_for(answer, 30.0)

    async def asset(self, uri):
        """Fetch a file; return its bytes, or the error."""
        number, answer = self._waiting()
        await self._websocket.send(json.dumps({"op": "fetchAsset", "uri": uri, "requestId": number}))
        return await asyncio.wait_for(answer, 30.0)

    def _waiting(self):
        self._number += 1
        self._answers[self._number] = asyncio.get_running_loop().create_future()
        return self._number, self._answers[self._number]


@asynccontextmanager
async def attached(address, **options):
    """Connect a client that reads its messages during the block."""
    connecting = websockets.connect(
        address, subprotocols=["foxglove.sdk.v1"], max_size=None, close_timeout=0.5, **options
    )
    async with connecting as websocket:
        client = Client(websocket)
        reading = asyncio.create_task(client.read())
        try:
            await client.until(lambda: client.info)
            yield client
        finally:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)
