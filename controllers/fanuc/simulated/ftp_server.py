"""FTP server of the simulated controller: it gives the files of its state, and takes none.

Its replies are those of public transcripts of real controllers where there are any. Everything that would
write is refused, and so is EPSV.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Iterable

from controllers.fanuc.ftp.protocol import FOLDER, File
from controllers.fanuc.simulated.controller import SOFTWARE
from controllers.fanuc.simulated.server import SnpxServer
from controllers.fanuc.simulated.state_files import content
from controllers.simulated import faults as effects

logger = logging.getLogger(__name__)

FTP_FAULTS = (
    *("freeze", "garbage", "split", "drop", "jump", "local", "fault", "mute", "joints", "restart", "refuse"),
    *("busy", "loss"),
)
"""Faults that this controller can show; the others concern commands, or data that comes unasked."""

_DATA_WITHIN_S = 10.0
_IDLE_S = 300.0
_PAUSE_S = 0.001
_FROZEN_EACH_S = 0.05
_LONGEST_LINE = 1024
_GARBAGE_EACH = 10


class FtpServer:
    """Server of one controller.

    Args:
        controlled: Server with the controller and its faults.

    Attributes:
        received: Names of all commands.
    """

    def __init__(self, controlled: SnpxServer) -> None:
        self.controlled = controlled
        self.received: list[str] = []
        self.files = 0

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Serve one client to its end."""
        client = _Client(self, reader, writer)
        try:
            with contextlib.suppress(OSError, TimeoutError, asyncio.IncompleteReadError, ValueError):
                await client.run()
        finally:
            client.close()


class _Client:
    """A client's connection, and its listener for the next file."""

    def __init__(self, server: FtpServer, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._server, self._reader, self._writer = server, reader, writer
        self._listener: asyncio.Server | None = None
        self._joined: asyncio.Future[asyncio.StreamWriter] | None = None
        self._logged_in = False

    def abort(self) -> None:
        """End the connection immediately."""
        self._writer.transport.abort()

    def close(self) -> None:
        """End the connection and what belongs to it."""
        self._server.controlled.clients.discard(self)
        self._leave_port()
        self._writer.close()

    async def run(self) -> None:
        """Answer commands."""
        if not self._server.controlled.admit(self):
            self.abort()
            return
        await self._reply(f"220 R-30iB FTP server ready. [{SOFTWARE}]")
        while True:
            async with asyncio.timeout(_IDLE_S):
                line = await self._reader.readline()
            if not line.endswith(b"\n") or len(line) > _LONGEST_LINE:
                return
            verb, _, argument = line.decode("latin-1").strip().partition(" ")
            self._server.received.append(verb.upper())
            if not await self._answer(verb.upper(), argument.strip()):
                return

    async def _answer(self, verb: str, argument: str) -> bool:
        """Answer one command; return whether there may be another."""
        match verb:
            case "USER":
                self._logged_in = True
                await self._reply("230 User logged in [NORM].")
            case "QUIT":
                await self._reply("221 Goodbye.")
                return False
            case "PASS" | "NOOP":
                await self._reply(f"200 {verb} command successful.")
            case "SYST":
                await self._reply("215 UNKNOWN")
            case _ if not self._logged_in:
                await self._reply("530 Not logged in.")
            case "TYPE" if argument.upper() in ("A", "I"):
                await self._reply(f"200 Type set to {argument.upper()}.")
            case "PWD" | "XPWD":
                await self._reply(f'257 "{FOLDER}" is the current device.')
            case "CWD" | "XCWD" if _is_folder(argument):
                await self._reply("250 CWD command successful.")
            case "PASV":
                await self._open_port()
            case "NLST" | "LIST":
                names = "".join(f"{each.value}\r\n" for each in File)
                await self._transfer(names.encode())
            case "RETR":
                await self._retrieve(argument)
            case "CWD" | "XCWD":
                await self._reply(f"550 {argument[:40]}: no such device.")
            case _:
                await self._reply(f"502 {verb[:10]} is not possible here.")
        return True

    async def _reply(self, text: str) -> None:
        await self._write(self._writer, f"{text}\r\n".encode("latin-1"))

    async def _write(self, writer: asyncio.StreamWriter, data: bytes) -> None:
        server = self._server.controlled
        server.apply_faults(time.monotonic())
        while "freeze" in server.active:
            await asyncio.sleep(_FROZEN_EACH_S)
        pieces: Iterable[bytes] = effects.pieces(data) if "split" in server.active else (data,)
        for each in pieces:
            writer.write(each)
            await writer.drain()
            if "split" in server.active:
                await asyncio.sleep(_PAUSE_S)

    # ------------------------------------------------------------------------- files

    async def _open_port(self) -> None:
        self._leave_port()
        host: str = self._writer.get_extra_info("sockname")[0]
        peer: str = self._writer.get_extra_info("peername")[0]
        joined = self._joined = asyncio.get_running_loop().create_future()

        def join(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            if joined.done() or writer.get_extra_info("peername")[0] != peer:
                writer.close()
            else:
                joined.set_result(writer)

        self._listener = await asyncio.start_server(join, host, 0)
        high, low = divmod(self._listener.sockets[0].getsockname()[1], 256)
        parts = ",".join([*(host.split(".") if host.count(".") == 3 else "0000"), str(high), str(low)])
        await self._reply(f"227 Entering Passive Mode ({parts})")

    def _leave_port(self) -> None:
        if self._listener is not None:
            self._listener.close()
        # A connection that is accepted but not joined yet is closed as it joins.
        if self._joined is not None and not self._joined.cancel() and not self._joined.cancelled():
            self._joined.result().close()
        self._listener = self._joined = None

    async def _retrieve(self, path: str) -> None:
        server, now_s = self._server.controlled, time.monotonic()
        server.apply_faults(now_s)
        name = path.upper().removeprefix("/").removeprefix("MD:").lstrip("/\\")
        file = next((each for each in File if each.value == name), None)
        if file is None or ("mute" in server.active and file is File.SIGNALS):
            await self._reply(f"550 {path[:40]}: the file does not exist.")
            return
        self._server.files += 1
        number = self._server.files
        if "busy" in server.active and number % 2:
            self._leave_port()
            await self._reply("450 Busy, try again.")
            return
        data = content(file, server.controller, now_s, server.active).replace("\n", "\r\n").encode("latin-1")
        index, rest = divmod(number, _GARBAGE_EACH)
        if "garbage" in server.active and not rest:
            # Each breaks another rule.
            others = (b"\xff" * 900, data[: len(data) // 2], data.replace(b".", b":"), b"", data * 2)
            data = others[index % len(others)]
        await self._transfer(data, whole="loss" not in server.active or bool(number % 3))

    async def _transfer(self, data: bytes, *, whole: bool = True) -> None:
        """Send a file on the connection for it, and say whether it is whole."""
        if self._joined is None:
            await self._reply("425 No port: PASV is first.")
            return
        await self._reply("150 Binary data connection.")
        try:
            async with asyncio.timeout(_DATA_WITHIN_S):
                writer = await self._joined
                await self._write(writer, data if whole else data[: len(data) // 2])
                writer.close()
                await writer.wait_closed()
        except TimeoutError:
            whole = False
        finally:
            self._leave_port()
        await self._reply(
            "226 Binary Transfer complete." if whole else "426 Connection closed; transfer aborted."
        )


def _is_folder(argument: str) -> bool:
    return argument.lower().strip("/\\") in (FOLDER, "")
