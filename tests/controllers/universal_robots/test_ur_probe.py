"""What a controller that is heard is taken for."""

from controllers.universal_robots.probe import RTDE


def test_packages_are_counted_up_to_an_incomplete_one():
    package = b"\0\0\0\x09\x10" + bytes(4)
    assert "it sends 2 packages" in RTDE.heard(2 * package + package[:-1]).text
