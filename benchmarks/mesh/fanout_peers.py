"""The peers of `fanout`, run with their Python: pyzmq (no broker), NATS, foxglove-sdk.

    python fanout_peers.py publish KIND ADDRESS FOLDER
    python fanout_peers.py receive KIND ADDRESS FOLDER COUNT

If the folder has a file "tls", the connections use TLS.
"""

import asyncio
import json
import struct
import sys
from pathlib import Path

from fanout_parts import (
    HEADER,
    ROBOTS,
    Ages,
    WebSocketReader,
    chosen,
    connected,
    publish,
    told_when,
    unchecked,
)

VIDEO = ROBOTS


def publish_role(kind: str, address: str, folder: str) -> None:
    globals()[f"publish_{kind}"](address, Path(folder))


def receive_role(kind: str, address: str, folder: str, count: str) -> None:
    asyncio.run(globals()[f"receive_{kind}"](address, Path(folder), int(count)))


def secured(folder: Path) -> bool:
    return (folder / "tls").exists()


# ------------------------------------------------------------------------- pyzmq


def publish_pyzmq(address: str, folder: Path) -> None:
    import zmq

    socket = zmq.Context().socket(zmq.PUB)
    if secured(folder):
        public, secret = (folder / "curve").read_bytes().split(b"\n")
        socket.curve_server, socket.curve_publickey, socket.curve_secretkey = True, public, secret
    socket.bind(f"tcp://{address}")

    def put(number: int, header: bytes, payload: bytes) -> None:
        socket.send(bytes([number]) + header + payload)

    publish(told_when(), folder, put, lambda _, header, payload: put(VIDEO, header, payload))


async def receive_pyzmq(address: str, folder: Path, count: int) -> None:
    import threading

    import zmq

    ages = Ages()

    def receive() -> None:
        context, poller = zmq.Context(), zmq.Poller()
        for _ in range(count):
            socket = context.socket(zmq.SUB)
            socket.subscribe(b"")
            if secured(folder):
                public, _ = (folder / "curve").read_bytes().split(b"\n")
                socket.curve_serverkey = public
                socket.curve_publickey, socket.curve_secretkey = zmq.curve_keypair()
            socket.connect(f"tcp://{address}")
            poller.register(socket, zmq.POLLIN)
        while True:
            for socket, _ in poller.poll():
                while True:
                    try:
                        message = socket.recv(zmq.NOBLOCK)
                    except zmq.Again:
                        break
                    ages.note(HEADER.unpack_from(message, 1)[2], message[0] == VIDEO)

    threading.Thread(target=receive, daemon=True).start()
    await ages.until_the_end(folder)


# -------------------------------------------------------------------------- NATS


def publish_nats(address: str, folder: Path) -> None:
    """Publish through a plain socket without the Python client: PUB is one line and the bytes."""
    import socket
    import threading

    host, port = address.split(":")
    line = socket.create_connection((host, int(port)))
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    line.recv(4096)  # INFO
    if secured(folder):
        line = unchecked().wrap_socket(line, server_hostname=host)
    line.sendall(b'CONNECT {"verbose":false,"pedantic":false}\r\n')
    window = told_when()

    def answer_pings() -> None:
        while data := line.recv(4096):
            if b"PING" in data:
                line.sendall(b"PONG\r\n")

    if not secured(folder):  # two threads must not use one TLS socket
        threading.Thread(target=answer_pings, daemon=True).start()

    def put(subject: str, header: bytes, payload: bytes) -> None:
        line.sendall(b"PUB %s %d\r\n%s%s\r\n" % (subject.encode(), 24 + len(payload), header, payload))

    publish(
        window,
        folder,
        lambda robot, header, payload: put(f"bench.arm-{robot}.joints", header, payload),
        lambda _, header, payload: put("bench.arm-0.video", header, payload),
    )


async def receive_nats(address: str, folder: Path, count: int) -> None:
    import nats

    ages = Ages()

    async def joints(message: "nats.aio.msg.Msg") -> None:
        ages.note(HEADER.unpack_from(message.data)[2], False)

    async def picture(message: "nats.aio.msg.Msg") -> None:
        ages.note(HEADER.unpack_from(message.data)[2], True)

    for _ in range(count):
        tls = {"tls": unchecked()} if secured(folder) else {}
        client = await nats.connect(f"nats://{address}", **tls)
        await client.subscribe("bench.*.joints", cb=joints)
        await client.subscribe("bench.arm-0.video", cb=picture)
        await client.flush()
    await ages.until_the_end(folder)


# ------------------------------------------------------------------ foxglove-sdk


def publish_foxglove(address: str, folder: Path) -> None:
    import foxglove

    host, port = address.split(":")
    tls = {}
    if secured(folder):
        tls = {"tls_cert": (folder / "tls").read_bytes(), "tls_key": (folder / "key").read_bytes()}
    foxglove.start_server(host=host, port=int(port), **tls)
    names = [f"/arm-{number}/joints" for number in range(ROBOTS)] + ["/arm-0/video"]
    schema = foxglove.Schema(name="bench", encoding="protobuf", data=b"-")  # no client reads it
    channels = [foxglove.Channel(name, message_encoding="protobuf", schema=schema) for name in names]

    def put(number: int, header: bytes, payload: bytes) -> None:
        channels[number].log(payload, log_time=HEADER.unpack(header)[2])

    publish(told_when(), folder, put, lambda _, header, payload: put(VIDEO, header, payload))


async def receive_foxglove(address: str, folder: Path, count: int) -> None:
    ages = Ages()

    async def one() -> None:
        video: set[int] = set()
        topics: set[str] = set()
        asked = asyncio.Event()

        def take(reader: WebSocketReader, opcode: int, message: bytes) -> None:
            if opcode == 2 and message[0] == 1:
                subscription, sent_ns = struct.unpack_from("<IQ", message, 1)
                ages.note(sent_ns, subscription in video)
            elif opcode == 1 and (told := json.loads(message)).get("op") == "advertise":
                wanted = [{"id": each["id"], "channelId": each["id"]} for each in told["channels"]]
                video.update(each["id"] for each in told["channels"] if each["topic"].endswith("/video"))
                reader.send(json.dumps({"op": "subscribe", "subscriptions": wanted}).encode(), 1)
                topics.update(each["topic"] for each in told["channels"])
                if len(topics) > ROBOTS:
                    asked.set()

        await connected(address, "/", secured(folder), take, "foxglove.sdk.v1")
        await asked.wait()

    for _ in range(count):
        await one()
    await ages.until_the_end(folder)


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent))
    chosen(publish=publish_role, receive=receive_role)
