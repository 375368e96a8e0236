"""A controller with another protocol needs one driver and one line in the registry.

The protocol is a line of JSON each way: {"q": [..], "state": "idle", "remote": true, "homed": true} in
radians from the controller, {"do": ["stop"]} or {"do": [{"to": [..]}]} to it.
"""

import asyncio
import contextlib
import json
import math

import pytest

from protocol_gateway.drivers.driver import (
    ALL,
    Activity,
    Capabilities,
    Channel,
    Home,
    JointsReceived,
    MalformedReceived,
    Mode,
    MoveAbsolute,
    Open,
    Refused,
    Report,
    Reset,
    Send,
    StatusReceived,
    Stop,
)
from protocol_gateway.drivers.registry import DRIVERS
from protocol_gateway.errors import CommandError
from robomesh.schemas import robomesh_pb2 as schema
from services.errors import SiteFileError
from services.site_file.site import load
from tests.conftest import run
from tests.protocol_gateway.gateway_site import STATE, A, C, gateway, refusal, until

_WORDS = {Home: "home", Stop: "stop", Reset: "reset"}


LINES = Channel(name="lines", carries=ALL)


class JsonLines:
    """Driver of JSON lines (`protocol_gateway.drivers.driver.Driver`)."""

    capabilities = Capabilities(commands=frozenset({Home, Stop, Reset, MoveAbsolute}))
    requests_a_second = 0.0

    def __init__(self, joint_types, codes, *, relay, options):
        self._joints = len(joint_types)
        self.ports = frozenset()
        self._rest, self._offset = b"", 0

    def started(self, now_s):
        return (Open(LINES),)

    def opened(self, channel, now_s):
        self._rest, self._offset = b"", 0
        return ()

    skipped = opened

    def closed(self, channel, now_s):
        return ()

    def received(self, channel, data, now_s):
        assert channel is LINES
        *lines, self._rest = (self._rest + data).split(b"\n")
        events = [event for line in lines for event in self._events(line)]
        refusals = sum(isinstance(event, Refused) for event in events)
        malformed = sum(isinstance(event, MalformedReceived) for event in events)
        return (Report(events, len(lines) - malformed, refusals),)

    def command(self, encoded, now_s):
        return (Send(LINES, encoded),)

    def _events(self, line):
        offset, self._offset = self._offset, self._offset + len(line) + 1
        try:
            fields = json.loads(line)
            if "no" in fields:
                events = [Refused(0, fields["no"])]
            else:
                if len(fields["q"]) != self._joints:
                    raise ValueError
                events = [
                    JointsReceived(tuple(fields["q"])),
                    StatusReceived(
                        activity=Activity(fields["state"]),
                        mode=Mode.REMOTE if fields["remote"] else Mode.LOCAL,
                        homed=fields["homed"],
                    ),
                ]
        except (ValueError, KeyError, TypeError):
            return [MalformedReceived(offset, line[:80].decode("ascii", "backslashreplace"), "no state")]
        return events

    def encode(self, *commands):
        return json.dumps({"do": [self._said(command) for command in commands]}).encode() + b"\n"

    def _said(self, command):
        if isinstance(command, MoveAbsolute):
            return {"to": command.positions}
        if type(command) not in _WORDS:
            raise CommandError(f"this controller knows no {type(command).__name__}")
        return _WORDS[type(command)]


@contextlib.asynccontextmanager
async def json_controller():
    """Run a controller that speaks JSON and executes commands immediately: (port, received commands)."""
    heard, state = [], {"q": [0.1] * 5, "state": "idle", "remote": True, "homed": True}

    async def listen(reader):
        async for line in reader:
            for what in json.loads(line)["do"]:
                heard.append(what)
                if what == "stop":
                    state["state"] = "stopped"
                elif what == "reset":
                    state["state"] = "idle"
                elif "to" in what:
                    state["q"] = what["to"]

    async def serve(reader, writer):
        listening = asyncio.create_task(listen(reader))
        try:
            while not listening.done():
                writer.write(json.dumps(state).encode() + b"\n")
                await asyncio.sleep(0.01)
        finally:
            listening.cancel()
            writer.transport.abort()

    server = await asyncio.start_server(serve, "127.0.0.1", 0)
    async with server:
        yield server.sockets[0].getsockname()[1], heard, state


def test_a_robot_of_another_protocol_is_shown_commanded_and_stopped_like_any_other(
    mesh, tmp_path, monkeypatch
):
    async def main():
        monkeypatch.setitem(DRIVERS, "json", JsonLines)
        async with (
            json_controller() as (port, heard, state),
            gateway(mesh, tmp_path, port, protocol="json") as site,
        ):
            await until(lambda: site.joints == [0.1] * 5)
            # Positions and state are two topics.
            await until(lambda: site.controller.mode == STATE.REMOTE)
            assert site.controller.homed == STATE.YES
            able = site.controller.capabilities
            assert able.stops == schema.Capabilities.ANY
            assert set(able.commands) == {C.HOME, C.RESET, C.MOVE_ABSOLUTE, C.MOVE_RELATIVE, C.RUN_PROGRAM}
            await site.lease(A.ACQUIRE, ttl_s=5)
            target = [0.2, 1.0, -0.5, 0.1, 0.3]
            await site.command(C.MOVE_ABSOLUTE, joint_positions=target)
            await until(lambda: site.joints == target)
            await site.lease(A.ACQUIRE, lease=site.secret, ttl_s=5)  # a busy machine may have taken over 5 s
            assert "this controller has no TRACE_ON" in await refusal(site.command(C.TRACE_ON))
            far = [math.radians(170.0), *target[1:]]
            assert "waist" in await refusal(site.command(C.MOVE_ABSOLUTE, joint_positions=far))
            stop = await site.stop(by="wang")
            await until(lambda: site.controller.activity == STATE.STOPPED)
            await site.lease(A.RENEW, ttl_s=5)
            await site.command(C.RESET, stop_id=stop.stop_id)
            await until(lambda: heard[-1] == "reset")
            state["q"] = [0.0] * 3
            await until(lambda: site.events("unit.malformed"))
            await until(lambda: site.controller.link == STATE.SILENT)

    run(main())


def test_an_unknown_protocol_is_refused_with_the_known_ones(tmp_path, monkeypatch):
    path = tmp_path / "site.toml"
    path.write_text('site = "hall"\n[[robot]]\nname = "arm"\nmodel = "pt600"\nprotocol = "json"\n')
    with pytest.raises(SiteFileError, match="'unit'") as caught:
        load(path)
    assert "protocol" in str(caught.value)
    monkeypatch.setitem(DRIVERS, "json", JsonLines)
    assert load(path).robot[0].protocol == "json"
