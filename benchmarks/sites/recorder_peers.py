"""Peers that write the same messages: `recorder` runs this with a Python that has them.

    PEERS_PYTHON benchmarks/sites/recorder_peers.py MESSAGES BYTES FOLDER

It imports no module of the project and measures the writers alone, without a network.
"""

import json
import sys
import time
from pathlib import Path
from typing import Any


def main() -> None:
    messages, size, folder = int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
    answer: dict[str, Any] = {}
    for name, write in (("mcap", mcap_), ("foxglove-sdk", foxglove_)):
        try:
            begun = time.perf_counter()
            version = write(folder / f"{name}.mcap", messages, bytes(range(256)) * (size // 256 + 1), size)
            rate = messages / (time.perf_counter() - begun)
            answer[name] = {"version": version, "messages_per_s": round(rate)}
        except Exception as error:  # not only ImportError: a peer may fail on another's old package
            answer[name] = {"missing": f"{type(error).__name__}: {error}"}
    print(json.dumps(answer))


def mcap_(path: Path, messages: int, payload: bytes, size: int) -> str:
    import mcap
    from mcap.writer import Writer

    data = payload[:size]
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        schema = writer.register_schema("bytes", "", b"")
        channel = writer.register_channel("topic", "", schema)
        for number in range(messages):
            writer.add_message(channel, number, data, number, number)
        writer.finish()
    return mcap.__version__


def foxglove_(path: Path, messages: int, payload: bytes, size: int) -> str:
    from importlib.metadata import version

    import foxglove

    data = payload[:size]
    with foxglove.open_mcap(path):
        channel = foxglove.Channel("topic", message_encoding="json")
        for number in range(messages):
            channel.log(data, log_time=number)
    return version("foxglove-sdk")


if __name__ == "__main__":
    main()
