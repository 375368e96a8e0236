"""Tests of the table `opcua` of site files."""

from pathlib import Path

import pytest

from services.command_line.service_settings.controllers import controller_addresses
from services.site_file.site import Site, resolve_site

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
        opcua_site({}, protocol="unit")


def test_two_devices_of_one_opc_ua_server_are_two_robots():
    two = [OPC_UA | {"name": name.lower(), "opcua": PINNED | {"device": name}} for name in ("Left", "Right")]
    site = Site.model_validate({"site": "hall", "robot": two})
    assert controller_addresses(site, [])["right"] == ("10.0.0.7", 4840, {})
