"""Tests of robots of Universal Robots in site files, and of the ports of their interfaces."""

import pytest

from services.command_line.service_settings.controllers import ControllerError, controller_addresses
from services.command_line.site.up import programs
from services.site_file.site import Site

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
