"""`python -m`: read one OPC UA server, and print its facts until the gateway ends.

Arguments: the gateway's process id, host, port, settings. It has no input: nothing that the mesh sends can
reach it. At its end it prints why on standard error.
"""

import asyncio
import contextlib
import ctypes
import logging
import os
import resource
import signal
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any

from robomesh.extras import missing

try:
    from asyncua import ua
except ImportError:
    raise SystemExit(missing("asyncua", "opcua")) from None

from controllers.opcua import facts
from controllers.opcua.facts import ItemsFound, Reading, Values, encode
from controllers.opcua.reader.discovery import Discovery
from controllers.opcua.reader.problems import ReadingError, in_words
from controllers.opcua.reader.security import secured_client
from controllers.opcua.reader.session import Changes, ReadOnlySession, Sampled, connected
from controllers.opcua.settings import OpcUaSettings, from_text
from robomesh.files.memory_limit import limit_memory

_PR_SET_PDEATHSIG = 1
_MEMORY_BYTES = 512 * 1024**2
_ENDS_WITHIN_S = 0.8
# Of all but axes: they change seldom.
_SLOW_S = 0.25
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def main(arguments: Sequence[str]) -> None:
    """Read until a signal, the gateway's end, or the connection's."""
    parent, host, port, settings = arguments
    # The signal lets it close its session, of which a server has few.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        return  # it ended before that call
    limit_memory(_MEMORY_BYTES)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    logging.disable(logging.CRITICAL)
    ending = ""
    try:
        asyncio.run(_until_signalled(host, int(port), from_text(settings)))
    except (ReadingError, MemoryError) as error:
        ending = str(error) or "the server sends more than fits into memory"
    except BrokenPipeError:
        pass  # the gateway is gone
    except Exception as error:
        ending = in_words(error)
    if ending:
        print(ending, file=sys.stderr, flush=True)
    # A library's thread or task must not keep it.
    os._exit(1 if ending else 0)


async def _until_signalled(host: str, port: int, settings: OpcUaSettings) -> None:
    loop = asyncio.get_running_loop()
    reading = asyncio.ensure_future(read(host, port, settings, _print))

    def end() -> None:
        reading.cancel()
        # A server that does not answer must not keep it.
        loop.call_later(_ENDS_WITHIN_S, os._exit, 0)

    loop.add_signal_handler(signal.SIGTERM, end)
    with contextlib.suppress(asyncio.CancelledError):
        await reading


def _print(line: bytes) -> None:
    # Each line is whole; a gateway that does not read stops it, and its subscription runs out.
    view = memoryview(line)
    while view:
        view = view[os.write(1, view) :]


async def read(host: str, port: int, settings: OpcUaSettings, write: Any) -> None:
    """Read a server until the connection ends.

    Args:
        write: Called with each line.

    Raises:
        ReadingError: If the server cannot be read, or the connection has ended.
    """
    url = f"opc.tcp://{f'[{host}]' if ':' in host else host}:{port}/{settings.path.lstrip('/')}"
    client = await secured_client(url.rstrip("/"), settings)
    ended: asyncio.Future[str] = asyncio.get_running_loop().create_future()

    def end(why: str) -> None:
        if not ended.done():
            ended.set_result(why)

    async def lost(error: Exception) -> None:
        end(in_words(error))

    client.connection_lost_callback = lost
    async with connected(client) as session:
        await _subscribe(session, settings, write, end)
        raise ReadingError(await ended)


async def _subscribe(session: ReadOnlySession, settings: OpcUaSettings, write: Any, end: Any) -> None:
    """Print what the server has, then each notification."""
    variables, server = await Discovery(session, settings).run()
    each_s = 1.0 / settings.rate_hz
    sampled = [
        Sampled(each.node, each_s, stamps=True)
        if each.item.kind in (facts.POSITION, facts.SPEED)
        else Sampled(each.node, max(each_s, _SLOW_S))
        for each in variables
    ]
    early: list[Changes] = []
    open_ = False

    def on_changes(changes: Changes) -> None:
        if not open_ and not changes.ended:
            early.append(changes)
        elif changes.ended:
            end(changes.ended)
        else:
            try:
                write(encode(_values(changes)))
            except OSError:
                end("the gateway does not read")

    intervals = await session.subscribe(sampled, each_s, on_changes)
    axes_s = [
        interval
        for each, interval in zip(variables, intervals, strict=True)
        if each.item.kind == facts.POSITION and isinstance(interval, float)
    ]
    refused = [
        f"{each.item.name or each.item.kind}: {interval}"
        for each, interval in zip(variables, intervals, strict=True)
        if isinstance(interval, str)
    ]
    if len(refused) == len(variables):
        raise ReadingError(f"the server lets none of its variables be read ({refused[0]})")
    if refused:
        server += f"; it does not let be read: {', '.join(refused[:3])}"
    slowest_s = max(axes_s, default=each_s)
    if axes_s and slowest_s > 1.5 * each_s:
        server += f"; it samples axes each {slowest_s:g} s, {each_s:g} s was asked for"
    write(encode(ItemsFound(tuple(each.item for each in variables), server, slowest_s)))
    open_ = True
    for changes in early:
        on_changes(changes)


def _values(changes: Changes) -> Values:
    return Values(tuple(_reading(number, data) for number, data in changes.values))


def _reading(number: int, data: ua.DataValue) -> Reading:
    value = None if data.Value is None else data.Value.Value
    if isinstance(value, ua.LocalizedText):
        value = value.Text
    if isinstance(value, str):
        value = value[: facts.LONGEST_TEXT]
    elif isinstance(value, int) and not isinstance(value, bool):
        value = float(value) if abs(value) < 2**1000 else None
    elif not isinstance(value, bool | float):
        value = None
    if isinstance(value, float) and not -1e300 < value < 1e300:
        value = None  # not finite, or without a meaning
    # StatusCode absent means Good.
    good = data.StatusCode is None or data.StatusCode.is_good()
    return Reading(number, value, _seconds(data.SourceTimestamp), good)


def _seconds(at: datetime | None) -> float | None:
    """Return a time as seconds since the Unix epoch; OPC UA's null is in 1601."""
    if at is None:
        return None
    at = at.replace(tzinfo=UTC) if at.tzinfo is None else at
    seconds = (at - _EPOCH).total_seconds()
    return seconds if seconds > 0.0 else None


if __name__ == "__main__":
    main(sys.argv[1:])
