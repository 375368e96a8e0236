"""Tests of the table `yaskawa` of site files."""

import pytest

from controllers.yaskawa.axes import with_factors
from controllers.yaskawa.table import Yaskawa
from services.command_line.service_settings.controllers import controller_addresses
from services.command_line.service_settings.table import SERVICES, Options
from services.command_line.site.up import programs
from services.site_file.site import Site

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
        ({"protocol": "unit"}, "protocol 'unit' needs tcp://10.0.0.7:10040"),
        (
            {"protocol": "unit", "controller": "tcp://10.0.0.7:1", "yaskawa": {}},
            "yaskawa needs the protocol 'hses'",
        ),
        ({"yaskawa": {"group": "R9"}}, "must be R1 to R8, B1 to B8 or S1 to S24"),
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
