"""Driver of FANUC's files by FTP: stepped, and in a gateway before the simulated controller."""

import contextlib
import math
from dataclasses import replace

import numpy as np
import pytest

from controllers.fanuc.axes import FanucSettings
from controllers.fanuc.ftp.driver import FILE, FTP, TIMEOUT_S, FtpDriver, fanuc_ftp_driver
from protocol_gateway.link.link import UnaskedSends
from protocol_gateway.seam import (
    Activity,
    AlarmReceived,
    AxesUndeclared,
    Close,
    JointsReceived,
    MalformedReceived,
    Open,
    Report,
    Send,
    SetTimer,
    Severity,
    SignalsReceived,
    SoftwareReceived,
    StatusReceived,
    Stop,
)
from protocol_gateway.seam.errors import CommandError, GatewaySettingsError
from robomesh import reason_codes as codes
from robomesh.wire.session import open_session
from robots.descriptions.description import load
from robots.kinematics.joints import JointType, joints_of
from robots.kinematics.model import build_model, tool_placement
from robots.schema.poses import axis_rotation
from tests.conftest import last_value
from tests.controllers.fanuc.ftp_site import (
    FANUC_FTP,
    SETTINGS,
    alarm,
    alarms,
    controller,
    frames,
    io_state,
    position,
    registers,
    stop_signals,
)
from tests.protocol_gateway.gateway_site import STATE, gateway, until
from tests.serving import serving

SIX = (JointType.ROTARY,) * 6
AXES = ("10.00", "20.00", "-30.00", ".50", "90.00", "-180.00")
PLACE = ("500.00", "-20.00", "800.00", "0.00", "0.00", "90.00")
NOW_S = 100.0
LOGGED_IN = ("220 R-30iB FTP server ready.", "230 User logged in [NORM].", "200 Type set.", "250 CWD done.")


class Stepped:
    """Driver with a test as its controller; a file that is asked for is answered from `content`.

    Attributes:
        sent: Lines that it has sent.
        events: All that it has reported.
        open: Ports of the connections for files.
        closed: Reasons of connections that it has ended.
    """

    def __init__(self, *, password="", **settings):
        self.settings = FanucSettings(**{"j23": 0, "rate_hz": 1.0, "io": ("DI[1-2]",), **settings})
        self.driver = FtpDriver(SIX, {}, options=self.settings, password=password)
        self._unasked = UnaskedSends(self.driver.requests_a_second)
        self.now_s = NOW_S
        self.sent, self.events, self.reports, self.ports, self.closed = [], [], [], [], []
        self.timer_s = None
        self.content = {
            "CURPOS.DG": position((1, AXES, PLACE)),
            "IOSTATE.DG": io_state(DIN1=True, UO1=True, UO2=True, UO3=False),
            "SFTYSIG.DG": stop_signals(),
            "ERRACT.LS": alarms(),
            "NUMREG.VA": registers(R1="12"),
            "SYSFRAME.VA": frames(1, (1, 2, 3, 0, 0, 0), (4, 5, 6, 0, 0, 0)),
        }
        assert self.driver.started(NOW_S) == (Open(FTP),)
        self.perform(self.driver.opened(FTP, self.now_s))

    def perform(self, effects):
        for effect in effects:
            match effect:
                case Send(channel, data):
                    assert channel is FTP
                    assert data.endswith(b"\r\n")
                    # The link sends no more than is declared, and drops the rest.
                    assert self._unasked.allowed(self.now_s)
                    self.sent.append(data.decode().rstrip())
                case SetTimer(at_s):
                    self.timer_s = at_s
                case Report():
                    self.reports.append(effect)
                    self.events += effect.events
                case Open(channel, port) if channel is FILE:
                    self.ports.append(port)
                case Close(channel, why) if channel is FTP:
                    self.closed.append(why)

    def say(self, *replies):
        for each in replies:
            self.perform(self.driver.received(FTP, f"{each}\r\n".encode(), self.now_s))

    def log_in(self):
        self.say(*LOGGED_IN)
        return self

    def wait(self):
        """Go on to the timer's end."""
        self.now_s = max(self.now_s, self.timer_s)
        self.perform(self.driver.timer_ended({}, self.now_s))

    def connect(self):
        """Answer PASV, and open the connection for the file; return its name."""
        while self.sent[-1] != "PASV":
            self.wait()
        self.say("227 Entering Passive Mode (9,9,9,9,4,1)")
        self.now_s += 0.01
        self.perform(self.driver.opened(FILE, self.now_s))
        return self.sent[-1].removeprefix("RETR ")

    def give(self, text=None, *, reply="226 Transfer complete.", early=False):
        """Give the next file that is asked for; return its name."""
        name = self.connect()
        data = (self.content[name] if text is None else text).encode()
        self.say("150 Binary data connection.")
        self.now_s += 0.02
        self.perform(self.driver.received(FILE, data[:100], self.now_s))
        self.perform(self.driver.received(FILE, data[100:], self.now_s))
        if early:
            self.say(reply)
        self.perform(self.driver.closed(FILE, self.now_s))
        if not early:
            self.say(reply)
        return name

    def round(self, number=5):
        return [self.give() for _ in range(number)]

    def of(self, kind):
        return [each for each in self.events if isinstance(each, kind)]

    def signals(self):
        """Return the newest values of all signals, by name."""
        return {signal.name: value for each in self.of(SignalsReceived) for signal, value in each.values}


def test_it_logs_in_once_and_reads_each_file_at_its_own_rate():
    it = Stepped(registers=(1,)).log_in()
    assert it.sent[:4] == ["USER anonymous", "TYPE I", "CWD md:", "PASV"]
    names = it.round(40)
    seconds = it.now_s - NOW_S
    for name, period_s in (("CURPOS.DG", 1), ("IOSTATE.DG", 2), ("ERRACT.LS", 2), ("NUMREG.VA", 5)):
        assert names.count(name) == pytest.approx(seconds / period_s, abs=1.5), name
    assert it.sent.count("USER anonymous") == 1
    assert len(it.sent) in (3 + 2 * 40, 3 + 2 * 40 + 1)
    assert len(it.sent) / seconds < it.driver.requests_a_second


def test_password_is_sent_only_when_it_is_asked_for():
    it = Stepped(user="li", password="secret")
    it.say("220-R-30iB", "220 ready", "331 Password required.", "230 in", "200 ok", "250 ok")
    assert it.sent == ["USER li", "PASS secret", "TYPE I", "CWD md:", "PASV"]
    refused = Stepped(user="li", password="secret")
    refused.say("220 ready", "331 Password required.", "530 Login incorrect.")
    assert refused.closed == ["it refuses the user li: 530 Login incorrect."]
    # Not again and again: a controller may lock the user.
    assert refused.timer_s == NOW_S + 30
    assert refused.driver.timer_ended({}, NOW_S + 30) == (Open(FTP),)


def test_joints_are_of_one_file_and_of_the_time_of_its_reading():
    it = Stepped(j23=1, reversed=(1,)).log_in()
    assert it.give() == "CURPOS.DG"
    (joints,) = it.of(JointsReceived)
    assert np.degrees(joints.positions) == pytest.approx([-10, 20, -10, 0.5, 90, -180])
    assert it.reports[-1].asked_s == pytest.approx(it.now_s - 0.02)
    assert (it.reports[-1].units, it.reports[-1].refusals) == (1, 0)
    signals = it.signals()
    assert [signals[f"tool.pose.{axis}"] for axis in ("x", "y", "z", "rz")] == pytest.approx(
        [0.5, -0.02, 0.8, math.pi / 2]
    )
    assert (signals["tool.number"], signals["frame.number"]) == (1, 0)
    assert signals["fanuc_ftp.configuration"] == "N U T, 0, 0, 0"
    assert it.of(SoftwareReceived) == [SoftwareReceived("V9.30146 5/27/2021")]
    assert not it.of(StatusReceived)


def test_end_of_the_file_and_its_confirmation_come_in_any_order():
    it = Stepped().log_in()
    it.give(early=True)
    it.give()
    assert len(it.reports) == 2
    assert it.of(JointsReceived)


def test_file_without_its_confirmation_is_not_used():
    it = Stepped().log_in()
    it.give(reply="426 Connection closed; transfer aborted.")
    assert not it.events
    assert (it.reports[-1].lost, it.reports[-1].refusals) == (1, 1)
    assert it.give() in it.content


def test_bytes_that_come_without_a_question_are_not_used():
    it = Stepped().log_in()
    it.perform(it.driver.received(FILE, b"Joint   1:     99.00\n", it.now_s))
    it.give()
    (joints,) = it.of(JointsReceived)
    assert np.degrees(joints.positions[0]) == pytest.approx(10)


def test_other_files_give_status_signals_and_alarms():
    it = Stepped(registers=(1, 2)).log_in()
    it.content["IOSTATE.DG"] = io_state(
        DIN1=True, UO1=True, UO2=True, UO3=True, UO4=False, UO5=False, UO6=False, UO8=False
    )
    it.content["ERRACT.LS"] = alarms(alarm("SRVO-037 IMSTP input"), alarm("JOG -010 Jog pressed", "WARN"))
    it.round(8)
    signals = it.signals()
    assert it.of(StatusReceived)[-1].activity is Activity.MOVING
    assert (signals["io.digital_in.1"], signals["io.digital_in.2"]) == (True, None)
    assert (signals["robot.servo"], signals["safety.emergency_stop"]) == (True, False)
    assert (signals["io.register.1"], signals["io.register.2"]) == (12.0, None)
    assert [signals[f"tool.offset.{axis}"] for axis in "xyz"] == pytest.approx([0.001, 0.002, 0.003])
    found = it.of(AlarmReceived)
    assert [(each.number, each.severity) for each in found] == [
        ("SRVO-037", Severity.ERROR),
        ("JOG-010", Severity.WARNING),
    ]
    assert found[1].text == "JOG -010 Jog pressed"
    it.round(8)
    assert it.of(AlarmReceived) == found
    it.content["ERRACT.LS"] = alarms(alarm("SRVO-037 IMSTP input", time="26-NOV-26 09:31:00"))
    it.round(8)
    assert len(it.of(AlarmReceived)) == 3


def test_frame_of_another_tool_is_not_shown():
    """The active tool is in two files, which are of different moments."""
    it = Stepped(tools=(1, 2)).log_in()
    it.round(8)
    assert it.signals()["tool.offset.x"] == pytest.approx(0.001)
    it.content["CURPOS.DG"] = position((1, AXES, PLACE, (), 0, 2))
    while it.give() != "CURPOS.DG":
        pass
    assert it.signals()["tool.offset.x"] is None
    it.content["SYSFRAME.VA"] = frames(2, (1, 2, 3, 0, 0, 0), (4, 5, 6, 0, 0, 0))
    assert it.give() == "SYSFRAME.VA"
    assert it.signals()["tool.offset.x"] == pytest.approx(0.004)
    listed = Stepped(tools=(1,)).log_in()
    listed.content["SYSFRAME.VA"] = it.content["SYSFRAME.VA"]
    listed.round(8)
    assert listed.signals()["tool.offset.x"] is None


def test_undeclared_coupling_gives_no_joints_but_the_rest():
    it = Stepped(j23=None).log_in()
    it.round(8)
    assert not it.of(JointsReceived)
    assert it.signals()["tool.pose.x"] == pytest.approx(0.5)
    assert it.driver.capabilities.no_joints is not None
    assert not it.driver.capabilities.reports_pose


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("-30.00", "*" * 10), "does not fit its field"),
        (lambda text: text[:300], "not whole"),
        (lambda text: text.replace("Group #:  1", "Group #:  2"), "group 1 is not in the file"),
        (lambda text: position((1, AXES[:4], PLACE)), "axis 5 is declared, but group 1 has 4"),
    ],
)
def test_position_that_cannot_be_used_is_said_and_gives_no_joints(change, words):
    it = Stepped().log_in()
    it.give(change(it.content["CURPOS.DG"]))
    assert not it.of(JointsReceived)
    (found,) = it.of(MalformedReceived)
    assert words in found.reason


def test_axis_that_no_joint_has_is_said_once_unless_it_is_declared():
    it = Stepped().log_in()
    extra = position((1, AXES, PLACE, ("0.00",)))
    it.content["CURPOS.DG"] = extra
    it.round(12)
    assert it.of(AxesUndeclared) == [AxesUndeclared(codes.AXES_EXTRA(axes="7"))]
    it.content["CURPOS.DG"] = position((1, AXES, PLACE))
    it.round(6)
    assert it.of(AxesUndeclared)[1:] == [AxesUndeclared(None)]
    declared = Stepped(other_axes=(7,)).log_in()
    declared.content["CURPOS.DG"] = extra
    declared.round(6)
    assert not declared.of(AxesUndeclared)


def test_file_that_the_controller_does_not_have_is_said_once_and_not_asked_for_again():
    it = Stepped().log_in()
    while it.connect() != "ERRACT.LS":
        it.say("550 no such file")
    asked = len(it.sent)
    it.say("550 no such file")
    assert it.reports[-1].refusals == 1
    assert any("does not give ERRACT.LS: 550" in each.reason for each in it.of(MalformedReceived))
    it.round(20)
    assert "RETR ERRACT.LS" not in it.sent[asked:]
    assert len(it.of(MalformedReceived)) == len({each.reason for each in it.of(MalformedReceived)})


@pytest.mark.parametrize(
    ("replies", "why"),
    [
        (("hello",), "no reply of FTP: 'hello'"),
        (("421 too many users",), "it ends the connection: 421 too many users"),
        (("220 x", "332 account"), "it refuses the user anonymous: 332 account"),
        (("220 x", "230 x", "500 no"), "an unexpected reply (state binary): 500 no"),
        ((*LOGGED_IN[:3], "550 no device"), "an unexpected reply (state folder): 550 no device"),
        ((*LOGGED_IN, "502 no PASV"), "an unexpected reply (state passive): 502 no PASV"),
        ((*LOGGED_IN, "227 none"), "an unexpected reply (state passive): 227 none"),
        ((*LOGGED_IN, "226 unasked"), "an unexpected reply (state passive): 226 unasked"),
    ],
)
def test_reply_that_does_not_fit_ends_the_connection_with_its_reason(replies, why):
    it = Stepped()
    it.say(*replies)
    assert it.closed == [why]
    sent = len(it.sent)
    it.say("220 x", "230 y")
    assert len(it.sent) == sent
    assert it.timer_s >= it.now_s + 5
    assert it.driver.timer_ended({}, it.timer_s) == (Open(FTP),)


def test_file_that_does_not_come_is_lost_and_ends_the_connection():
    """A later confirmation would else belong to the next file."""
    it = Stepped().log_in()
    it.connect()
    it.now_s = NOW_S + TIMEOUT_S + 1
    it.wait()
    assert it.reports[-1].lost == 1
    assert it.closed == ["CURPOS.DG did not come within 5 s"]


def test_port_that_is_not_open_and_files_without_end_end_the_connection():
    it = Stepped().log_in()
    it.say("227 Entering Passive Mode (9,9,9,9,4,1)")
    assert it.ports == [1025]
    it.perform(it.driver.closed(FILE, it.now_s))
    assert it.closed == ["the port that it named for a file is not open"]
    it = Stepped().log_in()
    it.connect()
    for _ in range(20):
        it.perform(it.driver.received(FILE, b"x" * 65536, it.now_s))
    assert it.closed[0] == "a file of more than 1 MiB"


def test_line_that_is_too_long_costs_its_file_only_and_is_not_matched():
    """An expression backtracked for seconds over an alarm with 30,000 blanks."""
    it = Stepped().log_in()
    while it.connect() != "ERRACT.LS":
        it.perform(it.driver.closed(FILE, it.now_s))
        it.say("226 Transfer complete.")
    it.perform(it.driver.received(FILE, b'ERRACT.LS \n1"a"b"c"' + b" " * 30_000 + b"x\n", it.now_s))
    it.perform(it.driver.closed(FILE, it.now_s))
    it.say("226 Transfer complete.")
    (malformed,) = it.reports[-1].events
    assert malformed.reason == "ERRACT.LS: a line of more than 2048 bytes"
    assert not it.closed


def test_nothing_is_ever_commanded():
    driver = Stepped().driver
    assert not driver.capabilities.commands
    assert driver.capabilities.slow_hz == 1.0
    with pytest.raises(CommandError):
        driver.prepare(Stop())
    assert driver.command(b"DELE x", NOW_S) == ()


def test_settings_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(GatewaySettingsError, match="no type codes"):
        fanuc_ftp_driver(SIX, {1: "COMMAND"})
    with pytest.raises(GatewaySettingsError, match="user or password: must have only printable"):
        fanuc_ftp_driver(SIX, {}, options=FanucSettings(user="a\r\nDELE x"))
    path = tmp_path / "password"
    missing = FanucSettings(user="li", password_file=str(path))
    with pytest.raises(GatewaySettingsError, match=r"password_file .*no such file"):
        fanuc_ftp_driver(SIX, {}, options=missing)
    path.write_text("secret\n")
    path.chmod(0o644)
    with pytest.raises(GatewaySettingsError, match="others may read it"):
        fanuc_ftp_driver(SIX, {}, options=missing)
    path.chmod(0o600)
    driver = fanuc_ftp_driver(SIX, {}, options=missing)
    driver.opened(FTP, 0.0)
    driver.received(FTP, b"220 x\r\n", 0.0)
    assert [*driver.received(FTP, b"331 x\r\n", 0.0)] == [Send(FTP, b"PASS secret\r\n")]


# ------------------------------------------------------------- in a gateway


async def test_gateway_shows_the_arm_its_alarms_and_that_it_is_slow(mesh, tmp_path):
    arm = joints_of(load("puma560"))
    model = build_model(load("puma560"))
    async with contextlib.AsyncExitStack() as stack:
        port = await stack.enter_async_context(controller(demo=True, faults=("fault@1+2",)))
        site = await stack.enter_async_context(gateway(mesh, tmp_path, port, up=False, **FANUC_FTP))
        await until(lambda: site.events("controller.alarm"))
        await until(lambda: site.controller.activity == STATE.FAULT)
        await until(lambda: site.controller.activity == STATE.MOVING)
        await until(lambda: len({tuple(j.position for j in s.joints) for s in site.seen["joints"]}) > 3)
        assert "SRVO-001" in site.events("controller.alarm")[0].text
        state = site.controller
        assert state.capabilities.slow_hz == SETTINGS.rate_hz
        assert (state.read_only, state.joints_unproven) == (True, True)
        assert state.software == "V0.00P/00 simulated"
        assert state.health.HasField("stamp_uncertainty_s")
        # The connections for single files are neither counted nor reported.
        assert state.counters.connections == 1
        assert not site.events("link.channel_lost")
        assert len(arm.types) == len(site.joints)
        async with open_session(mesh) as session:
            signals = (await last_value(session, site.key("signals"))).signals
        pose = {each.name: each.number for each in signals if each.name.startswith("tool.pose")}
        newest = site.seen["joints"][-1]
        placement = tool_placement(model, np.array([joint.position for joint in newest.joints]))
        # They are of different files' times while the arm moves: near, not equal.
        vector = np.array([pose[f"tool.pose.r{axis}"] for axis in "xyz"])
        turned = axis_rotation(vector, float(np.linalg.norm(vector)))
        assert np.linalg.norm(placement[:3, 3] - [pose[f"tool.pose.{axis}"] for axis in "xyz"]) < 0.2
        assert np.trace(turned.T @ placement[:3, :3]) > 2.5


async def test_controller_that_refuses_the_user_is_down_and_says_so(mesh, tmp_path):
    async def refuse(reader, writer):
        writer.write(b"220 R-30iB FTP server ready.\r\n")
        await reader.readline()
        writer.write(b"530 Not logged in.\r\n")
        # Until the gateway ends the connection.
        await reader.read()

    async with serving(refuse) as port:
        robot = {**FANUC_FTP, "options": replace(SETTINGS, user="li")}
        async with gateway(mesh, tmp_path, port, up=False, **robot) as site:
            await until(
                lambda: (
                    site.controller.link == STATE.DOWN
                    and "it refuses the user li: 530 Not logged in." in site.controller.link_text
                )
            )
