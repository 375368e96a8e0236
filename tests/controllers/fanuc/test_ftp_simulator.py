"""Simulated controller of FANUC's kind by FTP, read by the clients of Python and curl."""

import asyncio
import ftplib
import io
import shutil
import subprocess

import pytest

from controllers.fanuc.ftp import files
from controllers.fanuc.ftp.protocol import File
from controllers.fanuc.simulated.service import FtpSettings, serve_ftp
from controllers.simulated.errors import FaultError
from robomesh.errors import ListenError
from tests.controllers.fanuc.ftp_site import controller
from tests.controllers.fanuc.ftp_site import read as parsed

pytestmark = pytest.mark.slow

CURL = shutil.which("curl")


def read(port, *names):
    """Return files as Python's client reads them."""
    found = []
    with ftplib.FTP() as client:
        client.connect("127.0.0.1", port, timeout=20)
        client.login()
        client.cwd("md:")
        for name in names:
            content = io.BytesIO()
            client.retrbinary(f"RETR {name}", content.write)
            found.append(content.getvalue())
    return found


async def test_pythons_client_lists_and_reads_every_file():
    async with controller(faults=("fault",)) as port:
        names = [each.value for each in File]
        found = await asyncio.to_thread(read, port, *names)
    content = dict(zip(names, found, strict=True))
    assert parsed(files.position(1), content["CURPOS.DG"]).count == 6
    assert parsed(files.inputs_and_outputs(), content["IOSTATE.DG"])["UO", 6] is True
    assert parsed(files.safety(), content["SFTYSIG.DG"])["SOP Estop"] is True
    (alarm,) = parsed(files.active_alarms(), content["ERRACT.LS"])
    assert (alarm.message, alarm.severity) == ("SRVO-001 Operator panel E-stop", "SERVO")
    assert parsed(files.registers(), content["NUMREG.VA"])[1] == 12.5
    assert parsed(files.tools(1), content["SYSFRAME.VA"]).active == 1


async def test_nothing_can_be_written_deleted_or_executed():
    def attempt(port):
        refused = []
        with ftplib.FTP() as client:
            client.connect("127.0.0.1", port, timeout=20)
            client.login()
            for command in ("DELE A.TP", "MKD A", "RMD A", "RNFR A.TP", "SITE X", "STOR A.TP", "APPE A.TP"):
                with pytest.raises(ftplib.error_perm, match="502"):
                    client.sendcmd(command)
                refused.append(command)
            for command in ("RETR A.TP", "RETR ../../etc/passwd", "CWD fr:"):
                client.makepasv()
                with pytest.raises(ftplib.error_perm, match="550"):
                    client.sendcmd(command)
            return refused

    async with controller() as port:
        assert len(await asyncio.to_thread(attempt, port)) == 7


@pytest.mark.skipif(CURL is None, reason="needs curl")
async def test_curl_reads_a_position():
    async with controller() as port:
        command = (CURL, "-sS", "--max-time", "20", f"ftp://127.0.0.1:{port}/md:/CURPOS.DG")
        result = await asyncio.to_thread(subprocess.run, command, capture_output=True, check=True)
    assert parsed(files.position(1), result.stdout).place is not None


async def test_settings_that_cannot_be_used_are_refused():
    with pytest.raises(FaultError, match="flood"):
        await serve_ftp(FtpSettings(faults=("flood",)))
    async with controller() as port:
        with pytest.raises(ListenError, match=f"127.0.0.1:{port}: address already in use"):
            await serve_ftp(FtpSettings(listen=f"127.0.0.1:{port}"))
    with pytest.raises(ListenError, match="no TLS"):
        await serve_ftp(FtpSettings(listen="0.0.0.0:0"))
