"""Test of the example with a robot of each kind."""

from pathlib import Path

from protocol_gateway.configuration.kinds import own_kinds
from services.command_line.service_settings.table import SERVICES, Options
from services.site_file.site import load


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
