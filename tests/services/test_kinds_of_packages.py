"""Kinds of installed packages: table, probe and simulated controller work as those of robomesh."""

import socket
import sys
import textwrap
import threading

import pytest

from controllers import probing
from protocol_gateway.configuration.kinds import kind_with, part_of
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.simulated import Simulated
from services.command_line.doctor import machine, probe
from services.command_line.main import run
from services.command_line.site.up import programs
from services.errors import SiteFileError
from services.site_file.site import load

SITE = """
site = "hall"
[[robot]]
name = "arm"
model = "pt600"
protocol = "{}"
controller = "{}"
"""

PACKAGE = """
from collections.abc import Sequence
from typing import Annotated

from controllers.probing import Asked, Found, Probe
from protocol_gateway.seam.kind import Kind
from protocol_gateway.seam.simulated import Common, Option, Simulated, Started, options_of
from protocol_gateway.seam.table import Table


class Lines(Table):
    rate_hz: float = 20.0

    def simulated_options(self, robot, joint_types):
        return {"joints": len(joint_types)}


def found(heard):
    return Found(protocol="lines", text="lines") if heard.startswith(b"{") else None


def prepare(
    common: Common,
    *,
    rate: Annotated[float, Option(metavar="HZ", help="Lines a second", least=0)] = 20.0,
    word: Annotated[Sequence[str], Option(metavar="WORD")] = ("none",),
    quiet: Annotated[bool, Option(metavar="", help="Say less")] = True,
    table: Annotated[str, Option(metavar="JSON")] = "",
):
    async def run(tell):
        tell(f"{common['robot']} at {common['listen']}: {rate:g} {' '.join(word)} {quiet} {table}")

    return run


PROBE = Probe(listens=None, knows=lambda heard: bool(found(heard)), heard=found)
ASKS = Probe(
    ports=(30001, 7),
    asks=Asked(sent="x", question=b"x", enough=bool, meaning=lambda heard: 1 / 0),
    sends=3,
    knows=lambda heard: heard["q"],
    heard=lambda heard: heard["q"],
)
SIMULATED = Simulated(
    text="lines",
    listen="127.0.0.1:7000",
    prepare=prepare,
    started=lambda table, _: Started(options_of(table, "--table"), (("second", 7),)),
)
TAKES_ROBOT = Simulated(text="", listen="", prepare=lambda common, *, robot=1: None)
LINES = Kind(
    driver="lines:Driver",
    key="yaskawa",
    table="lines:Lines",
    packages=("lines_library",),
    extra="more",
    probe="lines:PROBE",
    simulated="lines:SIMULATED",
)
Driver = None
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Install a package that gives kinds by their protocols, as a dist-info does."""

    def installed(name, text="", **kinds):
        folder = tmp_path / name
        information = folder / f"{name}-1.0.dist-info"
        information.mkdir(parents=True)
        (folder / f"{name}.py").write_text(textwrap.dedent(text))
        (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: the-{name}\nVersion: 1.0\n")
        rows = "".join(f"{protocol} = {name}:{kind}\n" for protocol, kind in kinds.items())
        (information / "entry_points.txt").write_text(f"[robomesh.drivers]\n{rows}")
        monkeypatch.syspath_prepend(str(folder))

    monkeypatch.setattr(probing, "LISTEN_S", 0.3)
    monkeypatch.setattr(probing, "ANSWER_S", 0.3)
    probe._note.cache_clear()
    yield installed
    for name in ("lines", "bad", "other"):
        sys.modules.pop(name, None)


def bad(install, **parts):
    text = "".join(f", {name}={value!r}" for name, value in parts.items())
    install("bad", f"from protocol_gateway.seam.kind import Kind\nBAD = Kind(driver=None{text})\n", bad="BAD")


def server(says):
    """Send bytes to the first client, from a thread; return the address."""
    listening = socket.create_server(("127.0.0.1", 0))

    def serve():
        with listening, listening.accept()[0] as connection:
            connection.sendall(says)
            connection.recv(100)

    threading.Thread(target=serve, daemon=True).start()
    return "tcp://{}:{}".format(*listening.getsockname())


@pytest.fixture
def lines(install):
    install("lines", PACKAGE, lines="LINES")


def test_a_probe_of_a_package_knows_its_controller(lines, capsys):
    assert run(["probe", server(b'{"q": 1}\n')]) == 0
    shown = capsys.readouterr()
    assert ": lines\n  sent: nothing; received: 9 bytes" in shown.out
    assert shown.err == ""


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"probe": "bad:NONE"}, ["probe = 'bad:NONE', of the package the-bad, cannot", "controllers.prob"]),
        (
            {"probe": "no_such:PROBE"},
            ["No module named 'no_such'; it must be 'module:name' of a controllers.probing.Pr"],
        ),
        ({"probe": "bad"}, ["of the package the-bad, cannot be imported"]),
        (
            {"probe": "bad:Kind"},
            ["of the package the-bad, is of the type type; it must be 'module:name' of a"],
        ),
        ({"probe": 3}, ["of the package the-bad, cannot be imported"]),
        ({"probe": "lines:ASKS"}, ["its probe, of the package the-bad, fails: TypeError"]),
    ],
)
def test_a_probe_that_cannot_be_used_is_noted_once_and_the_others_are_tried(
    install, lines, capsys, parts, words
):
    bad(install, **parts)
    assert run(["probe", server(b'{"q": 1}\n')]) == 0
    shown = capsys.readouterr()
    assert ": lines\n" in shown.out
    assert shown.err.count("\n") == 1
    assert shown.err.startswith("robomesh: protocol 'bad': ")
    for each in words:
        assert each in shown.err


def test_a_package_that_cannot_be_imported_stops_no_probe(install, capsys):
    install("other", "raise SystemExit('no licence')", other="OTHER")
    assert run(["probe", server(b"1#ABSOLUTE.DEG*1;2@1#ABSOLUTE.DEG*1;2@")]) == 0
    shown = capsys.readouterr()
    assert "with 2 joints" in shown.out
    assert shown.err == (
        "robomesh: protocol 'other': its driver, of the package the-other, cannot be imported: no licence\n"
    )


def test_a_package_asks_at_its_own_ports_only_and_its_failure_is_named(install, lines):
    bad(install, probe="lines:ASKS")
    known = {"first": probing.Probe(listens=(30001,)), **probe.probes()}
    assert probe._asked(7, known)[0] == "bad"
    assert probe._asked(30001, known) == ("first", None)
    with pytest.raises(probing.ProbeError, match="the-bad, fails: ZeroDivisionError"), probe._fails_as("bad"):
        known["bad"].asks.meaning(b"")


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ((), "puma560 at 127.0.0.1:7000: 20 none True "),
        (
            ("--rate", "0", "--word", "a", "--word", "b", "--no-quiet", "--table", "{}"),
            "puma560 at 127.0.0.1:7000: 0 a b False {}",
        ),
        (("--robot", "pt600", "--listen", "h:1"), "pt600 at h:1: 20 none True "),
    ],
)
def test_a_simulated_controller_of_a_package_has_its_own_options(lines, capsys, options, line):
    assert run(["simulate", *options, "--protocol", "lines"]) == 0
    assert capsys.readouterr().out == f"{line}\n"


def test_the_help_of_a_packages_protocol_has_its_options(lines, capsys):
    assert run(["simulate", "--protocol=lines", "--help"]) == 0
    shown = capsys.readouterr().out
    assert "Lines a second" in shown
    assert "[default: (127.0.0.1:7000)]" in shown
    assert run(["simulate", "--help"]) == 0
    assert "Lines a second" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({}, "--protocol bad: this protocol has no simulated controller"),
        (
            {"simulated": "no_such:S"},
            "'bad': simulated = 'no_such:S', of the package the-bad, cannot be import",
        ),
        (
            {"simulated": "bad:BAD"},
            "is of the type Kind; it must be 'module:name' of a protocol_gateway.seam.simulated.S",
        ),
        (
            {"simulated": "lines:TAKES_ROBOT"},
            "options of its simulated controller, of the package the-bad, ca",
        ),
    ],
)
def test_a_simulated_controller_that_cannot_be_used_is_named_with_its_package(
    install, lines, capsys, parts, words
):
    bad(install, **parts)
    assert run(["simulate", "--protocol", "bad"]) == 2
    shown = capsys.readouterr().err
    assert words in shown
    assert shown.count("\n") == 1
    assert run(["simulate", "--protocol", "x"]) == 2
    assert "unknown protocol 'x'; known: unit, " in capsys.readouterr().err


def test_a_site_starts_the_simulated_controller_of_a_package(lines, tmp_path):
    path = tmp_path / "site.toml"
    path.write_text(SITE.format("lines", "simulated") + "driver = { rate_hz = 7 }\n")
    site = load(path)
    _, simulator, gateway, *_ = programs(site, path, "tcp/127.0.0.1:7447")
    words = " ".join(simulator.arguments)
    assert "--protocol lines --table {" in words
    assert '"rate_hz":7.0' in words
    assert gateway.arguments[-1].endswith(",second=7")
    assert site.robot[0].driver_options == {"joints": 5}
    assert site.robot[0].kind.key == "driver"


def test_a_site_file_names_what_its_package_cannot_do(install, lines, tmp_path):
    bad(install)
    path = tmp_path / "site.toml"
    for protocol, controller, words in (
        ("bad", "simulated", "'bad' has no simulator"),
        ("lines", "udp://10.0.0.7:5000", "protocol 'lines' needs tcp://10.0.0.7:5000"),
    ):
        path.write_text(SITE.format(protocol, controller))
        with pytest.raises(SiteFileError, match=words):
            load(path)
    sys.modules["bad"] = None
    install("other", "OTHER = 1 / 0", other="OTHER")
    path.write_text(SITE.format("other", "simulated"))
    with pytest.raises(SiteFileError, match="'other': its driver, of the package the-other, cannot be imp"):
        load(path)


def test_only_the_package_that_is_named_is_imported(install, lines, tmp_path, capsys):
    install("other", "raise SystemExit", other="OTHER")
    path = tmp_path / "site.toml"
    path.write_text(SITE.format("lines", "simulated"))
    load(path)
    assert run(["simulate", "--protocol", "lines"]) == 0
    assert run(["simulate", "--help"]) == 0
    assert "other" not in sys.modules
    assert capsys.readouterr().err == ""


def test_doctor_looks_for_the_drivers_that_the_site_names(install, lines, tmp_path, monkeypatch):
    path = tmp_path / "site.toml"
    path.write_text(SITE.format("lines", "simulated"))
    (found,) = machine._drivers(load(path))
    assert (found.ok, found.text, found.fix) == (False, "no lines_library", "pip install 'the-lines[more]'")
    assert kind_with("lines_library").distribution == "the-lines"
    monkeypatch.setattr(machine, "is_missing", lambda module: False)
    (found,) = machine._drivers(load(path))
    assert (found.ok, found.text) == (True, "the package the-lines is installed")
    bad(install, simulated="no_such:S")
    path.write_text(SITE.format("bad", "simulated"))
    (found,) = machine._drivers(load(path))
    assert not found.ok
    assert "simulated = 'no_such:S', of the package the-bad" in found.text


def test_a_part_that_a_kind_does_not_have_is_none(install):
    bad(install)
    assert part_of("bad", "simulated", Simulated) is None
    with pytest.raises(GatewaySettingsError, match="unknown protocol 'x'"):
        part_of("x", "simulated", Simulated)
