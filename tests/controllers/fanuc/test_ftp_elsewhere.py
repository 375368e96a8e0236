"""FANUC's files by FTP with programs of others; skipped without them (CONTRIBUTING.md)."""

import asyncio
import importlib.util
import os
import shutil
import threading
from pathlib import Path

import pytest

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.ftp.driver import fanuc_ftp_driver
from controllers.fanuc.ftp.protocol import File
from protocol_gateway.link.link import ControllerLink, LinkSettings
from protocol_gateway.seam import AlarmReceived, JointsReceived, MalformedReceived, SignalsReceived
from robots.kinematics.joints import JointType
from tests.conftest import run
from tests.controllers.fanuc import ftp_site
from tests.protocol_gateway.gateway_site import until
from tests.protocol_gateway.scripted_controller import endless_joints

# pyftpdlib uses a module that later versions of Python do not have.
pytestmark = [pytest.mark.slow, pytest.mark.filterwarnings("ignore::DeprecationWarning")]

WITH_SERVER = pytest.mark.skipif(importlib.util.find_spec("pyftpdlib") is None, reason="needs pyftpdlib")
FOLDERS = [Path(each) for each in os.environ.get("FANUC_BACKUPS", "").split(os.pathsep) if each]


class Server:
    """The server of pyftpdlib with files, for a user with a password, or for anonymous ones."""

    def __init__(self, folder, *, user="", password=""):
        from pyftpdlib.authorizers import DummyAuthorizer
        from pyftpdlib.handlers import FTPHandler
        from pyftpdlib.servers import FTPServer

        authorizer = DummyAuthorizer()
        # It may only change the folder, list and read.
        if user:
            authorizer.add_user(user, password, str(folder), perm="elr")
        else:
            authorizer.add_anonymous(str(folder), perm="elr")
        self.commands = []
        server = self

        class Handler(FTPHandler):
            def pre_process_command(self, line, cmd, arg):
                server.commands.append(f"{cmd} {arg}".strip())
                super().pre_process_command(line, cmd, arg)

        Handler.authorizer = authorizer
        self._server = FTPServer(("127.0.0.1", 0), Handler)
        self.port = self._server.socket.getsockname()[1]
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self):
        while not self._ends.is_set():
            self._server.serve_forever(timeout=0.05, blocking=False)
        self._server.close_all()

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ends.set()
        self._thread.join()


async def reported(port, enough, *, joints=6, **settings):
    """Run a link to a server until it is enough; return what was reported."""
    events = []
    driver = fanuc_ftp_driver((JointType.ROTARY,) * joints, {}, options=FanucSettings(**settings))
    link = ControllerLink(
        LinkSettings(host="127.0.0.1", port=port),
        driver,
        endless_joints(joints),
        on_event=lambda event, _: events.append(event),
    )
    task = asyncio.create_task(link.run())
    try:
        await until(lambda: enough(events))
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
    return events


def of(kind, events):
    return [each for each in events if isinstance(each, kind)]


def folder_with(path, **files):
    """Make the device of a controller with files, named as in ftp_site."""
    device = path / "md:"
    device.mkdir(parents=True)
    for name, content in files.items():
        (device / name.replace("_", ".")).write_text(content)
    return path


@WITH_SERVER
def test_files_of_pyftpdlib_are_read_with_a_password_and_nothing_else_is_asked_for(tmp_path):
    axes, place = ("10.00", "20.00", "-30.00", ".50", "90.00", "-180.00"), ("500.00",) * 3 + (".00",) * 3
    folder = folder_with(
        tmp_path / "files",
        CURPOS_DG=ftp_site.position((1, axes, place)),
        IOSTATE_DG=ftp_site.io_state(UO1=True, UO2=True),
        SFTYSIG_DG=ftp_site.stop_signals(),
        ERRACT_LS=ftp_site.alarms(ftp_site.alarm("SRVO-037 IMSTP input")),
    )
    secret = tmp_path / "secret"
    secret.write_text("pass word\n")
    secret.chmod(0o600)
    with Server(folder, user="li", password="pass word") as server:
        events = run(
            reported(
                server.port,
                lambda events: len(of(JointsReceived, events)) > 3 and of(AlarmReceived, events),
                j23=0,
                rate_hz=10.0,
                user="li",
                password_file=str(secret),
            )
        )
    assert of(JointsReceived, events)[0].positions[0] == pytest.approx(0.17453292519943295)
    assert of(AlarmReceived, events)[0].number == "SRVO-037"
    # It has no tools, which is said once.
    assert ["550" in each.reason for each in of(MalformedReceived, events)] == [True]
    known = {
        "USER li",
        "PASS pass word",
        "TYPE I",
        "CWD md:",
        "PASV",
        *(f"RETR {each.value}" for each in File),
    }
    assert {*server.commands} <= known


@WITH_SERVER
@pytest.mark.skipif(not FOLDERS, reason="FANUC_BACKUPS names no folder with files of a controller")
@pytest.mark.parametrize("backup", FOLDERS, ids=lambda each: each.name)
def test_files_of_real_controllers_are_read_from_pyftpdlib(tmp_path, backup):
    device = tmp_path / "md:"
    device.mkdir()
    names = {each.value for each in File}
    for each in backup.iterdir():
        if each.name.upper() in names:
            shutil.copy(each, device / each.name.upper())
    with Server(tmp_path) as server:
        events = run(
            reported(
                server.port,
                lambda events: (
                    of(JointsReceived, events)
                    and any(
                        signal.name == "tool.offset.x"
                        for e in of(SignalsReceived, events)
                        for signal, _ in e.values
                    )
                ),
                j23=1,
                rate_hz=10.0,
                tools=tuple(range(1, 11)),
            )
        )
    assert not of(MalformedReceived, events)
