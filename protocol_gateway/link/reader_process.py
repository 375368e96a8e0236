"""Program that reads a controller for a channel: the channel receives its standard output.

The program gets its settings as arguments and has no input, so nothing can be sent to it. Its first output
means that it is connected. It ends when the gateway ends, and its last line on standard error is the reason.
"""

import asyncio
import contextlib
import os
import signal
import sys
from collections.abc import Callable, Sequence
from typing import Self, cast

from protocol_gateway.link.connection import READ_BYTES
from protocol_gateway.seam.errors import LinkDownError
from robomesh import reason_codes as codes
from robomesh.reasons import Reason
from robomesh.texts import one_line

CONNECTS_WITHIN_S = 30.0
"""A busy machine imports its libraries within this time, and a slow server answers."""

_ENDS_WITHIN_S = 1.0
_MOST_ERROR_BYTES = 4096
_LONGEST_REASON = 400
_OUTPUT, _ERRORS = 1, 2


class ReaderProcessError(Exception):
    """The program ended before it was connected; the text is its own reason."""


class ReaderProcess(asyncio.SubprocessProtocol):
    """A running program; the future `lost` gets the reason when it has ended."""

    round_trip_s = None

    def __init__(
        self, on_connected: Callable[["ReaderProcess"], None], receive: Callable[[bytes], None], name: str
    ) -> None:
        self._on_connected = on_connected
        self._receive = receive
        self._name = name
        self._errors = b""
        loop = asyncio.get_running_loop()
        self.lost: asyncio.Future[Reason] = loop.create_future()
        self._first: asyncio.Future[None] = loop.create_future()
        self._closed: asyncio.Future[None] = loop.create_future()
        self._transport: asyncio.SubprocessTransport | None = None

    @classmethod
    async def started(
        cls,
        module: str,
        arguments: Sequence[str],
        on_connected: Callable[["ReaderProcess"], None],
        receive: Callable[[bytes], None],
    ) -> Self:
        """Start the program `python -m module PARENT arguments...`.

        Raises:
            OSError: If it cannot start.
        """
        _, program = await asyncio.get_running_loop().subprocess_exec(
            lambda: cls(on_connected, receive, module),
            *(sys.executable, "-P", "-m", module, str(os.getpid()), *arguments),
            stdin=asyncio.subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C must reach only the gateway
            pipesize=READ_BYTES,  # asyncio reads all that a pipe holds in one turn of the loop
        )
        return program

    async def connected(self) -> None:
        """Wait until the program is connected.

        Raises:
            ReaderProcessError: If the program ended before.
            TimeoutError: If it does not connect in time; the program is ended.
        """
        try:
            async with asyncio.timeout(CONNECTS_WITHIN_S):
                ends: list[asyncio.Future[None] | asyncio.Future[Reason]] = [self._first, self.lost]
                await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        except BaseException:
            await self.end()
            raise
        if not self._first.done():
            reason = self.lost.result()
            await self.end()
            raise ReaderProcessError(str(reason))

    # ------------------------------------------------------------------ called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the process (called by asyncio)."""
        self._transport = cast("asyncio.SubprocessTransport", transport)

    def pipe_data_received(self, fd: int, data: bytes) -> None:
        """Pass its output on, and keep the end of its errors (called by asyncio)."""
        if fd == _ERRORS:
            self._errors = (self._errors + data)[-_MOST_ERROR_BYTES:]
            return
        if self.lost.done():
            return
        try:
            if not self._first.done():
                self._first.set_result(None)
                self._on_connected(self)
            self._receive(data)
        except Exception as error:
            # Make it end `run`; asyncio would only log it.
            if not self.lost.done():
                self.lost.set_exception(error)
            self._signal(signal.SIGKILL)

    def connection_lost(self, error: Exception | None) -> None:
        """Note the end, after the last output (called by asyncio)."""
        if not self.lost.done():
            self.lost.set_result(codes.OTHER(detail=self._why()))
        self._closed.set_result(None)

    def _why(self) -> str:
        lines = self._errors.decode(errors="replace").strip().splitlines()
        if lines:
            return one_line(lines[-1], _LONGEST_REASON)
        status = None if self._transport is None else self._transport.get_returncode()
        return f"its reading process {self._name} ended with status {status}"

    # ----------------------------------------------------------------------- of a channel

    def write(self, data: bytes) -> None:
        """Refuse: the program has no input.

        Raises:
            LinkDownError: Always.
        """
        raise LinkDownError(codes.READS_ONLY())

    def pause(self, seconds: float) -> None:
        """Stop reading for some seconds; the program waits."""
        output = None if self._transport is None else self._transport.get_pipe_transport(_OUTPUT)
        if isinstance(output, asyncio.ReadTransport) and not output.is_closing():
            output.pause_reading()
            asyncio.get_running_loop().call_later(seconds, self._resume, output)

    @staticmethod
    def _resume(output: asyncio.ReadTransport) -> None:
        if not output.is_closing():
            output.resume_reading()

    async def end(self) -> None:
        """End the program: ask it to close its session, and kill it if it does not."""
        if not self.lost.done():
            self.lost.set_result(codes.LINK_CLOSED())
        if self._transport is None:
            return
        try:
            self._signal(signal.SIGTERM)
            await asyncio.wait([self._closed], timeout=_ENDS_WITHIN_S)
        finally:
            self._signal(signal.SIGKILL)
            self._transport.close()
        await self._closed

    def _signal(self, number: signal.Signals) -> None:
        with contextlib.suppress(ProcessLookupError):
            if self._transport is not None:
                self._transport.send_signal(number)
