"""The project's own arms of `fanout`, and the bare router.

    python -m benchmarks.mesh.fanout_ours publish KIND ADDRESS FOLDER
    python -m benchmarks.mesh.fanout_ours receive KIND ADDRESS FOLDER COUNT
    python -m benchmarks.mesh.fanout_ours route ADDRESS FOLDER

If the folder has a file "tls", the connections use TLS.
"""

import asyncio
import base64
import contextlib
import json
import signal
import struct
from pathlib import Path
from typing import Any

from benchmarks.mesh.fanout_parts import HEADER, ROBOTS, Ages, chosen, publish, told_when, watch_console
from robomesh.contract.endpoints import Tls, client_config
from robomesh.wire.session import SessionSettings, open_session

JOINTS, VIDEO = "robomesh/bench/*/joints", "robomesh/bench/arm-0/video/free"


def tls_of(folder: Path) -> Tls | None:
    return (
        Tls(ca=folder / "ca", certificate=folder / "tls", key=folder / "key") if is_secured(folder) else None
    )


def is_secured(folder: Path) -> bool:
    return (folder / "tls").exists()


def endpoint_of(address: str, folder: Path) -> str:
    return f"{'tls' if is_secured(folder) else 'tcp'}/{address}"


def bare_config(folder: Path, **values: Any) -> Any:
    """Return a Zenoh configuration without the project's settings, except the keys."""
    import zenoh

    config = zenoh.Config()
    values["scouting/multicast/enabled"] = False
    if is_secured(folder):
        values |= {
            "transport/link/tls/root_ca_certificate": f"{folder}/ca",
            "transport/link/tls/enable_mtls": True,
            "transport/link/tls/listen_certificate": f"{folder}/tls",
            "transport/link/tls/listen_private_key": f"{folder}/key",
            "transport/link/tls/connect_certificate": f"{folder}/tls",
            "transport/link/tls/connect_private_key": f"{folder}/key",
        }
    for key, value in values.items():
        config.insert_json5(key, json.dumps(value))
    return config


def route(address: str, folder: str) -> None:
    import zenoh

    listen = {"listen/endpoints": [endpoint_of(address, Path(folder))]}
    with zenoh.open(bare_config(Path(folder), mode="router", **listen)):
        signal.pause()


def publish_role(kind: str, address: str, folder: str) -> None:
    asyncio.run(publish_robomesh(address, Path(folder))) if kind == "robomesh" else publish_zenoh(
        address, Path(folder)
    )


async def publish_robomesh(address: str, folder: Path) -> None:
    settings = SessionSettings(connect=(endpoint_of(address, folder),), tls=tls_of(folder), wait_s=20.0)
    async with open_session(settings) as session:
        robots = [session.declare_publisher("bench", f"arm-{number}", "joints") for number in range(ROBOTS)]
        video = session.declare_publisher("bench", "arm-0", "video/free")
        first = payload_of_key_frame(folder)

        def put(publisher: Any, header: bytes, payload: bytes) -> None:
            source = HEADER.unpack(header)[2]
            publisher.put_bytes(payload, source_time_ns=source, key_frame=len(payload) == first)

        def run() -> None:
            publish(
                told_when(),
                folder,
                lambda robot, header, payload: put(robots[robot], header, payload),
                lambda _, header, payload: put(video, header, payload),
            )

        await asyncio.to_thread(run)


def payload_of_key_frame(folder: Path) -> int:
    """Return the key frame's length, which distinguishes it from the other frames."""
    return int(struct.unpack("<I", (folder / "video").read_bytes()[:4])[0])


def publish_zenoh(address: str, folder: Path) -> None:
    import zenoh

    connect = {"connect/endpoints": [endpoint_of(address, folder)]}
    with zenoh.open(bare_config(folder, mode="client", **connect)) as session:
        robots = [
            session.declare_publisher(f"robomesh/bench/arm-{number}/joints") for number in range(ROBOTS)
        ]
        video = session.declare_publisher(VIDEO)
        publish(
            told_when(),
            folder,
            lambda robot, header, payload: robots[robot].put(payload, attachment=header),
            lambda _, header, payload: video.put(payload, attachment=header),
        )


def receive_role(kind: str, address: str, folder: str, count: str) -> None:
    if kind == "page":
        from robomesh.schemas.robomesh_pb2 import FromPage

        watches = [FromPage(watch=FromPage.Watch(key=key)).SerializeToString() for key in (JOINTS, VIDEO)]
        coded = [base64.b64encode(each).decode() for each in watches]
        asyncio.run(watch_console(address, is_secured(Path(folder)), coded, int(count), Path(folder)))
    else:
        asyncio.run(receive_zenoh(kind, address, Path(folder), int(count)))


async def receive_zenoh(kind: str, address: str, folder: Path, count: int) -> None:
    import zenoh

    endpoint, ages = endpoint_of(address, folder), Ages()
    with contextlib.ExitStack() as stack:
        for _ in range(count):
            if kind == "robomesh":
                config = client_config((endpoint,), tls_of(folder))
            else:
                config = bare_config(folder, mode="client", **{"connect/endpoints": [endpoint]})
            session = stack.enter_context(zenoh.open(config))
            for key, picture in ((JOINTS, False), (VIDEO, True)):
                session.declare_subscriber(key, noting(ages, picture))
        await ages.until_the_end(folder)


def noting(ages: Ages, picture: bool) -> Any:
    def note(sample: Any) -> None:
        ages.note(HEADER.unpack(sample.attachment.to_bytes())[2], picture)

    return note


if __name__ == "__main__":
    chosen(publish=publish_role, receive=receive_role, route=route)
