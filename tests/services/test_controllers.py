"""Addresses of controllers, from the site file and from options."""

from pathlib import Path

import pytest

from controllers.fanuc.simulated.service import with_defaults
from controllers.fanuc.table import Fanuc
from controllers.yaskawa.simulated.service import with_factors
from controllers.yaskawa.table import Yaskawa
from protocol_gateway.kinds import own_kinds
from robots.joints import JointType
from services.command_line.site.controllers import ControllerError, controller_addresses
from services.command_line.site.services import SERVICES, Options
from services.command_line.site.up import programs
from services.site_file.site import Site, load, resolve_site

UR = {"name": "ur", "model": "puma560", "protocol": "rtde", "controller": "tcp://10.0.0.7:30004"}


def site(**robot):
    return Site.model_validate({"site": "hall", "robot": [UR | robot]})


def test_a_controller_has_the_site_files_ports_unless_an_option_has_others():
    assert controller_addresses(site(), [])["ur"] == ("10.0.0.7", 30004, {})
    assert controller_addresses(site(ports={"primary": 7}), [])["ur"] == ("10.0.0.7", 30004, {"primary": 7})
    option = "ur=tcp://127.0.0.1:5,primary=6"
    assert controller_addresses(site(ports={"primary": 7}), [option])["ur"] == (
        "127.0.0.1",
        5,
        {"primary": 6},
    )


@pytest.mark.parametrize("other", ["primary", "primary=", "=5", "primary=0", "primary=65536", "primary=x"])
def test_another_interface_needs_a_name_and_a_port(other):
    with pytest.raises(ControllerError, match="primary=30011"):
        controller_addresses(site(), [f"ur=tcp://127.0.0.1:5,{other}"])


def test_a_simulated_robot_with_rtde_gets_a_simulator_that_the_gateway_can_reach():
    simulated = site(controller="simulated", demo=True)
    found = {each.name: each.arguments for each in programs(simulated, None, "tcp/127.0.0.1:7447")}
    words = found["simulate ur"]
    assert words[words.index("--protocol") :][:2] == ("--protocol", "rtde")
    names = ("primary", "scripts", "dashboard")
    listen, *others = (words[words.index(f"--{name}") + 1] for name in ("listen", *names))
    option = found["gateway"][found["gateway"].index("--controller") + 1]
    address = controller_addresses(simulated, [option])["ur"]
    assert (f"{address.host}:{address.port}", address.ports) == (
        listen,
        {name: int(other.rpartition(":")[2]) for name, other in zip(names, others, strict=True)},
    )


HSES = {"name": "welder", "model": "puma560", "protocol": "hses", "controller": "udp://10.0.0.7:10040"}


def hses_site(*robots):
    return Site.model_validate({"site": "hall", "robot": [HSES | robot for robot in robots]})


def test_a_controller_with_two_arms_is_two_robots_of_different_groups():
    two = hses_site({}, {"name": "helper", "yaskawa": {"group": "R2"}})
    assert controller_addresses(two, [])["helper"] == ("10.0.0.7", 10040, {})
    with pytest.raises(ValueError, match="given twice, to robot welder's controller and to robot helper's"):
        hses_site({}, {"name": "helper"})


@pytest.mark.parametrize(
    ("robot", "problem"),
    [
        ({"controller": "tcp://10.0.0.7:10040"}, "protocol 'hses' needs udp://10.0.0.7:10040"),
        ({"protocol": "rtde"}, "protocol 'rtde' needs tcp://10.0.0.7:10040"),
        (
            {"protocol": "rtde", "controller": "tcp://10.0.0.7:1", "yaskawa": {}},
            "yaskawa needs the protocol 'hses'",
        ),
        ({"yaskawa": {"group": "R9"}}, "R1 to R8, B1 to B8 and S1 to S24 are right"),
        ({"yaskawa": {"axes": [9]}}, "less than or equal to 8"),
        ({"yaskawa": {"rate": 1000}}, "less than or equal to 100"),
        ({"yaskawa": {"pulses": [1]}}, "Extra inputs"),
    ],
)
def test_what_a_site_file_declares_wrongly_of_a_yaskawa_robot_is_refused(robot, problem):
    with pytest.raises(ValueError, match=problem):
        hses_site(robot)


def test_a_simulated_robot_with_hses_gets_a_simulator_with_the_same_pulses():
    declared = {"pulses_per_degree": [500.0] * 6, "group": "R2"}
    for yaskawa, factor in ((None, 1000.0), ({"group": "R2"}, 1000.0), (declared, 500.0)):
        simulated = hses_site({"controller": "simulated", "yaskawa": yaskawa})
        found = {each.name: each.arguments for each in programs(simulated, None, "tcp/127.0.0.1:7447")}
        words = found["simulate welder"]
        assert words[words.index("--protocol") + 1] == "hses"
        option = found["gateway"][found["gateway"].index("--controller") + 1]
        listen = words[words.index("--listen") + 1]
        assert option == f"welder=udp://{listen}"
        settings = SERVICES["gateway"].settings(simulated, Options(controllers=[option]))
        assert [*settings.robots[0].options.pulses_per_degree] == [factor] * 6
        if yaskawa:
            told = Yaskawa.model_validate_json(words[words.index("--yaskawa") + 1])
            assert with_factors(told.settings, 6) == settings.robots[0].options


FANUC = {"name": "loader", "model": "puma560", "protocol": "snpx", "controller": "tcp://10.0.0.7:60008"}


def fanuc_site(*robots):
    return Site.model_validate({"site": "hall", "robot": [FANUC | robot for robot in robots]})


def test_a_controller_of_fanuc_with_two_groups_is_two_robots():
    two = fanuc_site({}, {"name": "track", "fanuc": {"group": 2}})
    assert [robot.group for robot in two.robot] == ["G1", "G2"]
    with pytest.raises(ValueError, match="given twice"):
        fanuc_site({}, {"name": "track"})


@pytest.mark.parametrize(
    ("robot", "problem"),
    [
        ({"controller": "udp://10.0.0.7:60008"}, "protocol 'snpx' needs tcp://10.0.0.7:60008"),
        ({"protocol": "rtde", "fanuc": {}}, "fanuc needs the protocol 'fanuc-ftp' or 'snpx'"),
        ({"fanuc": {"user": "li"}}, "fanuc.user needs the protocol 'fanuc-ftp'"),
        ({"fanuc": {"rate": 0.5}}, "fanuc.rate 0.5: with the protocol 'snpx' 1 to 100 is right"),
        ({"fanuc": {"j23": 2}}, "Input should be -1, 0 or 1"),
        ({"fanuc": {"assignments": "yes"}}, "'own' or 'pendant'"),
        ({"fanuc": {"io": ["GI[1]"]}}, r"as in DI\[1-16\]"),
        ({"fanuc": {"registers": [1, 1]}}, "each once"),
        ({"fanuc": {"registers": [0]}}, "greater than or equal to 1"),
        ({"fanuc": {"tools": [11]}}, "less than or equal to 10"),
        ({"fanuc": {"group": 9}}, "less than or equal to 8"),
        ({"fanuc": {"coupling": 1}}, "Extra inputs"),
    ],
)
def test_what_a_site_file_declares_wrongly_of_a_fanuc_robot_is_refused(robot, problem):
    with pytest.raises(ValueError, match=problem):
        fanuc_site(robot)


def test_a_simulated_robot_with_snpx_gets_a_simulator_with_the_same_axes():
    declared = {"assignments": "pendant", "j23": -1, "group": 2}
    for fanuc, expected in (
        (None, ("own", 1, 1)),
        ({"group": 2}, ("own", 1, 2)),
        (declared, ("pendant", -1, 2)),
    ):
        simulated = fanuc_site({"controller": "simulated", "fanuc": fanuc})
        found = {each.name: each.arguments for each in programs(simulated, None, "tcp/127.0.0.1:7447")}
        words = found["simulate loader"]
        assert words[words.index("--protocol") + 1] == "snpx"
        option = found["gateway"][found["gateway"].index("--controller") + 1]
        assert option == f"loader=tcp://{words[words.index('--listen') + 1]}"
        settings = SERVICES["gateway"].settings(simulated, Options(controllers=[option])).robots[0].options
        assert (settings.assignments, settings.j23, settings.group) == expected
        if fanuc:
            told = Fanuc.model_validate_json(words[words.index("--fanuc") + 1])
            assert (
                with_defaults(told.options(simulated.robot[0].declared), (JointType.ROTARY,) * 6) == settings
            )


FTP = {"protocol": "fanuc-ftp", "controller": "tcp://10.0.0.7:21"}


@pytest.mark.parametrize(
    ("fanuc", "robot", "rate", "stale_s"),
    [
        (None, {}, 1.0, 3.0),
        ({"rate": 2}, {}, 2.0, 1.5),
        ({"rate": 0.2}, {}, 0.2, 15.0),
        ({"rate": 2}, {"stale_after_s": 1.0}, 2.0, 1.0),
    ],
)
def test_a_position_a_second_by_ftp_is_not_stale_before_the_next(fanuc, robot, rate, stale_s):
    (loader,) = fanuc_site(FTP | {"fanuc": fanuc} | robot).robot
    assert (loader.options.rate_hz, loader.stale_time_s) == (rate, stale_s)
    assert (loader.options.user, loader.options.password_file) == ("anonymous", "")
    assert fanuc_site({"fanuc": fanuc and {}}).robot[0].stale_time_s == 1.0


@pytest.mark.parametrize(
    ("robot", "problem"),
    [
        ({"stale_after_s": 1.0}, "with 1 positions a second 2 or more is right"),
        ({"fanuc": {"rate": 3}}, "with the protocol 'fanuc-ftp' at most 2"),
        ({"fanuc": {"rate": 0.1}}, "greater than or equal to 0.2"),
        ({"fanuc": {"motion": True, "assignments": "own", "j23": 1}}, "fanuc.assignments needs"),
        ({"fanuc": {"speed": 5}}, "fanuc.speed needs the protocol 'snpx'"),
        ({"fanuc": {"password_file": "x"}}, "fanuc.password_file needs user"),
        ({"fanuc": {"user": "a b"}}, "String should match pattern"),
        ({"controller": "udp://10.0.0.7:21"}, "protocol 'fanuc-ftp' needs tcp://10.0.0.7:21"),
    ],
)
def test_what_a_site_file_declares_wrongly_of_a_robot_by_ftp_is_refused(robot, problem):
    with pytest.raises(ValueError, match=problem):
        fanuc_site(FTP | robot)


def test_a_password_file_is_beside_the_site_file(tmp_path):
    path = tmp_path / "site.toml"
    path.write_text(
        'site = "hall"\n[[robot]]\nname = "a"\nmodel = "puma560"\nprotocol = "fanuc-ftp"\n'
        'controller = "tcp://10.0.0.7:21"\nfanuc = { user = "li", password_file = "secret" }\n'
    )
    (robot,) = load(path).robot
    assert (robot.options.user, robot.options.password_file) == ("li", str(tmp_path / "secret"))


def test_a_simulated_robot_by_ftp_gets_a_simulator_with_the_same_axes():
    simulated = fanuc_site(FTP | {"controller": "simulated", "fanuc": {"j23": -1, "group": 2}})
    found = {each.name: each.arguments for each in programs(simulated, None, "tcp/127.0.0.1:7447")}
    words = found["simulate loader"]
    assert words[words.index("--protocol") + 1] == "fanuc-ftp"
    option = found["gateway"][found["gateway"].index("--controller") + 1]
    settings = SERVICES["gateway"].settings(simulated, Options(controllers=[option])).robots[0].options
    assert (settings.j23, settings.group, settings.rate_hz) == (-1, 2, 1.0)
    told = Fanuc.model_validate_json(words[words.index("--fanuc") + 1])
    assert (told.j23, told.group) == (-1, 2)


OPC_UA = {"name": "handler", "model": "puma560", "protocol": "opcua", "controller": "tcp://10.0.0.7:4840"}
PINNED = {"server_certificate": "AB:" * 31 + "ab", "certificate": "keys/opcua.pem"}


def opcua_site(part, **robot):
    return Site.model_validate({"site": "hall", "robot": [OPC_UA | {"opcua": part} | robot]})


@pytest.mark.parametrize(
    ("part", "problem"),
    [
        (None, "opcua.server_certificate is missing"),
        ({"server_certificate": "ab" * 32}, "opcua.certificate is missing"),
        ({"server_certificate": "ab"}, "64 hexadecimal digits"),
        ({"security": "none"}, "beyond this machine needs insecure = true"),
        ({"security": "none", "user": "a", "password_file": "b"}, "a password is not sent"),
        (PINNED | {"user": "a"}, "user and password_file need each other"),
        (PINNED | {"joints": [{}]}, "either axis or node"),
        (PINNED | {"joints": [{"node": "J1"}]}, "should be a NodeId"),
        (PINNED | {"joints": [{"axis": "A"}, {"axis": "A"}]}, "A is given for two joints"),
        (PINNED | {"signals": [{"name": "Bad Name", "node": "i=1"}]}, "lower-case words"),
        (PINNED | {"signals": [{"name": "a", "node": "i=1"}] * 2}, "two signals are named a"),
        (PINNED | {"rate": 1000}, "less than or equal to 100"),
    ],
)
def test_what_a_site_file_declares_wrongly_of_an_opc_ua_server_is_refused(part, problem):
    with pytest.raises(ValueError, match=problem):
        opcua_site(part)


def test_opc_ua_is_encrypted_unless_the_site_file_says_otherwise():
    site = opcua_site(PINNED | {"user": "a", "password_file": "password"})
    robot = resolve_site(site, Path("/site")).robot[0]
    assert robot.options.security == "sign_and_encrypt"
    assert robot.options.server_certificate == "ab" * 32
    assert (robot.options.certificate, robot.options.password_file) == (
        "/site/keys/opcua.pem",
        "/site/password",
    )
    assert opcua_site(None, controller="simulated").robot[0].options.security == "none"
    unencrypted = {"security": "none", "insecure": True}
    assert opcua_site(unencrypted).robot[0].options.security == "none"
    here = opcua_site({"security": "none"}, controller="tcp://127.0.0.1:4840")
    assert here.robot[0].options.security == "none"
    with pytest.raises(ValueError, match="opcua needs the protocol 'opcua'"):
        opcua_site({}, protocol="rtde")


def test_two_devices_of_one_opc_ua_server_are_two_robots():
    two = [OPC_UA | {"name": name.lower(), "opcua": PINNED | {"device": name}} for name in ("Left", "Right")]
    site = Site.model_validate({"site": "hall", "robot": two})
    assert controller_addresses(site, [])["right"] == ("10.0.0.7", 4840, {})


def test_the_example_has_a_simulated_controller_of_each_protocol():
    example = load(Path(__file__).resolve().parents[2] / "examples" / "vendors.toml")
    assert {robot.protocol for robot in example.robot} == {*own_kinds()}
    ways = {"unit": "tcp", "rtde": "tcp", "hses": "udp", "snpx": "tcp", "fanuc-ftp": "tcp", "opcua": "tcp"}
    named = enumerate(example.robot, start=1)
    addresses = [f"{robot.name}={ways[robot.protocol]}://127.0.0.1:{port}" for port, robot in named]
    settings = SERVICES["gateway"].settings(example, Options(controllers=addresses))
    assert [robot.protocol for robot in settings.robots] == [*ways]
    # One that gives a position a second is not stale between two of them.
    assert [robot.stale_after_s for robot in settings.robots] == [1.0, 1.0, 1.0, 1.0, 3.0, 1.0]
