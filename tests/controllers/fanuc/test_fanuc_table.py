"""Tests of the table `fanuc` of site files."""

import pytest

from controllers.fanuc.axes import with_defaults
from controllers.fanuc.table import Fanuc
from robots.kinematics.joints import JointType
from services.command_line.service_settings.table import SERVICES, Options
from services.command_line.site.up import programs
from services.site_file.site import Site, load

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
        ({"protocol": "unit", "fanuc": {}}, "fanuc needs the protocol 'fanuc-ftp' or 'snpx'"),
        ({"fanuc": {"user": "li"}}, "fanuc.user needs the protocol 'fanuc-ftp'"),
        ({"fanuc": {"rate": 0.5}}, "fanuc.rate 0.5: must be 1 to 100 with the protocol 'snpx'"),
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
        ({"stale_after_s": 1.0}, "must be 2 or more with 1 positions a second"),
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
