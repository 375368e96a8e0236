"""`robomesh send`: it renews its lease, and waits for the end of its motion or program."""

import asyncio
import os
import signal
import sys

import pytest

from robomesh import reason_codes as codes
from robomesh.contract.keys import parse_key
from robomesh.errors import MessageError, RefusedError
from robomesh.requests.requests import ask_all
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.command_line.control import send
from services.command_line.terminal import discovery
from tests.conftest import run
from tests.protocol_gateway.gateway_site import A, until

KEY = "robomesh/hall/arm/lease/request/li"
RUNNING = schema.ProgramState(
    outcome=schema.ProgramState.RUNNING, line=2, statement="wait 1", step=7, steps=90
)


class Owner:
    """A gateway that grants a lease, answers some renewals, and delays others."""

    def __init__(self, session):
        self.renewed = self.waiting = 0
        self.taken, self.end = False, asyncio.Event()
        session.answer("hall", "arm", "lease/request/*", self._answer)

    async def _answer(self, request):
        match request.message.action:
            case A.ASK:
                self.waiting += 1
                await self.end.wait()
            case A.RENEW if self.taken:
                raise RefusedError("eve has control")
            case A.RENEW:
                self.renewed += 1
        return schema.LeaseAnswer(lease="secret")


class Gateway(Owner):
    """A gateway that also accepts commands: it answers a program when `ready` is set."""

    def __init__(self, session, *states, text="RUN_PROGRAM: it runs", stops=True):
        super().__init__(session)
        self.asked, self.stops, self.ready = [], [], asyncio.Event()
        self._states, self._text = states, text
        self._program = session.declare_publisher("hall", "arm", "program")
        session.answer("hall", "arm", "command/*", self._command)
        if stops:
            session.answer("hall", "arm", "stop", self._stop)

    async def _command(self, request):
        self.asked.append(request.message)
        await self.ready.wait()
        return schema.CommandAnswer(accepted=True, text=self._text)

    async def _stop(self, request):
        self.stops.append(request.message.reason)
        return schema.StopAnswer(sent=True, text="stop 1 is sent")

    async def publish_states(self):
        """Publish its states repeatedly."""
        while True:
            for state in self._states:
                self._program.put(state)
                await asyncio.sleep(0.05)


def sent(li):
    """Start a task with `robomesh send hall/arm run`, and return it."""
    run = send.send_and_wait(li, discovery.RobotAddress("hall", "arm"), "li", lambda arm: arm.run("home"))
    return asyncio.create_task(run)


async def test_a_busy_renewal_is_repeated_and_a_refused_one_ends_control(mesh):
    async with open_session(mesh) as session, open_session(mesh) as li, open_session(mesh) as eve:
        gateway = Gateway(session, RUNNING)
        gateway.ready.set()
        publishing = asyncio.create_task(gateway.publish_states())
        outcome = sent(li)
        await until(lambda: gateway.asked and gateway.renewed)
        asks, asked = schema.LeaseRequest(action=A.ASK).SerializeToString(), []
        async with asyncio.timeout(40):
            while gateway.waiting < 16:
                one = ask_all(eve.zenoh_session, parse_key(KEY), asks, timeout_s=20.0)
                asked.append(asyncio.create_task(one))
                await asyncio.sleep(0.01)
        before = gateway.renewed
        # Two renewals, each repeated for half a second.
        await asyncio.wait((outcome,), timeout=2.2)
        assert gateway.renewed == before
        assert not outcome.done()
        gateway.end.set()
        await until(lambda: gateway.renewed > before)
        gateway.taken = True
        assert await outcome == (False, "control ended before the motion did: eve has control", "")
        assert gateway.stops == []
        await asyncio.gather(*asked)
        publishing.cancel()


async def test_ctrl_c_stops_a_program_during_its_check(mesh):
    async with open_session(mesh) as session, open_session(mesh) as li:
        gateway = Gateway(session)
        outcome = sent(li)
        await until(lambda: gateway.asked)
        signal.raise_signal(signal.SIGINT)
        assert await outcome == (False, "interrupted: stop 1 is sent", "")
        assert gateway.stops == ["Ctrl-C in robomesh send"]
        gateway.ready.set()


@pytest.mark.slow
async def test_a_silent_gateway_is_reported_with_advice_and_an_unanswered_stop_in_words(mesh):
    async with open_session(mesh) as session, open_session(mesh) as li:
        gateway = Gateway(session, stops=False)
        gateway.ready.set()
        accepted, text, _ = await sent(li)
        assert not accepted
        assert text.startswith("the gateway fell silent: the state of hall/arm is unknown. `robomesh send")
        interrupted = sent(li)
        await until(lambda: len(gateway.asked) == 2)
        signal.raise_signal(signal.SIGINT)
        accepted, text, _ = await interrupted
        assert not accepted
        assert text.startswith("interrupted: the stop failed: no answer to robomesh/hall/arm/stop")


async def test_a_gateway_restart_is_reported_with_advice_and_warnings_are_printed_first(mesh, capsys):
    async with open_session(mesh) as session, open_session(mesh) as li:
        gateway = Gateway(
            session, RUNNING, schema.ProgramState(), text="RUN_PROGRAM: it runs; mind: arm touches post"
        )
        gateway.ready.set()
        publishing = asyncio.create_task(gateway.publish_states())
        ended = await sent(li)
        publishing.cancel()
        accepted, text, warning = ended
    assert (accepted, warning) == (False, "arm touches post")
    assert text.startswith("the gateway restarted, so the program no longer runs")
    assert "`robomesh send hall/arm stop`" in text
    # Printed once, before the motion.
    assert "arm touches post" not in text
    first, *rest = capsys.readouterr().err.splitlines()
    assert first == "warning: arm touches post"
    assert all(line == "step 7 of 90, line 2: wait 1" for line in rest)


def test_a_program_goes_on_when_the_reader_of_its_progress_is_gone(mesh, monkeypatch):
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w") as progress:  # noqa: PTH123

        async def main():
            async with open_session(mesh) as session, open_session(mesh) as li:
                gateway = Gateway(session, RUNNING, schema.ProgramState())
                gateway.ready.set()
                publishing = asyncio.create_task(gateway.publish_states())
                ended = await sent(li)
                publishing.cancel()
                return ended

        monkeypatch.setattr(sys, "stderr", progress)
        assert run(main()).text.startswith("the gateway restarted")


def test_the_advice_of_a_refusal_is_a_command():
    def sentence(reason, text=""):
        error = RefusedError(reason, text=text)
        return send.with_commands(error, discovery.RobotAddress("hall", "arm"))

    assert sentence(codes.STOP_LATCHED(id=3, by="li", reason="with another lease")) == (
        "stop 3 is latched (li: with another lease): remove the cause, then `robomesh send hall/arm reset`"
    )
    other = codes.LEASE_OTHER(name="li")
    assert sentence(other, f"{other}.") == (
        f"{other}. Only that window or program can hold what it moves; Ctrl-C there, or "
        "`robomesh send hall/arm stop`, ends it"
    )
    assert sentence("link down") == "link down"
    # An earlier gateway sends no codes.
    assert sentence(str(other)) == str(other)


@pytest.mark.parametrize(
    ("words", "options", "text"),
    [
        (["recover"], {}, "recover needs one name: unlock_protective_stop"),
        (["recover", "power_on"], {}, "--reason"),
        (["recover", "power_on"], {"reason": " "}, "--reason"),
        (["recover", "power_on"], {"reason": "fuse"}, "--looked"),
        (["home"], {"reason": "fuse"}, "belong to recover"),
    ],
)
def test_a_recovery_needs_a_name_a_reason_and_a_look(words, options, text):
    with pytest.raises(send.WordsError, match=text):
        send.send("hall/arm", words, operator="li", **options)


async def test_a_recovery_is_sent_with_its_reason(mesh):
    async with open_session(mesh) as session, open_session(mesh) as own:
        gateway = Gateway(own, text="power_on is on the controller's socket")
        gateway.ready.set()
        command = send._recovery(["power_on"], "fuse\nchanged", True)
        sent = await send.send_and_wait(session, discovery.RobotAddress("hall", "arm"), "li", command)
        assert (sent.accepted, sent.text) == (True, "power_on is on the controller's socket")
        (asked,) = gateway.asked
        recover = schema.Recover(recovery=schema.Recover.POWER_ON, reason="fuse changed", looked=True)
        assert asked.recover == recover
        with pytest.raises(MessageError, match="no recovery 'dance': use unlock_protective_stop"):
            await send.send_and_wait(
                session, discovery.RobotAddress("hall", "arm"), "li", send._recovery(["dance"], "x", True)
            )
