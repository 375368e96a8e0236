"""The table of commands: lazy imports, and the options of the contract's table."""

import json
import os
import re
import signal
import socket
import subprocess
import sys
from pathlib import Path

import click
import pytest

from services.command_line import main
from services.command_line.commands import COMMANDS, load
from services.command_line.main import run
from services.command_line.service_settings.table import SERVICES
from services.site_file.site import Site
from services.site_file.tables.console import Console
from services.site_file.tables.router import Router
from tests.conftest import SHARED
from tests.ports import free_port

ROOT = Path(__file__).resolve().parents[2]
# Command -> the options that the contract names.
CONTRACT = {
    "up": (),
    **dict.fromkeys(
        ("router", "gateway", "kinematics", "recorder", "renderer", "console", "store"),
        ("--site", "--connect"),
    ),
    "simulate": ("--robot", "--listen", "--rate", "--max-clients", "--demo", "--fault"),
    "list": ("--json",),
    "monitor": ("--json",),
    "signals": ("--follow", "--json"),
    "send": ("--json",),
    "probe": ("--json",),
    "robot check": ("--json",),
    "robot show": ("--json",),
    "robot import": (),
    "robot export": (),
    "shapes info": ("--json",),
    "shapes convert": (),
    "fk": ("--robot", "--json"),
    "ik": ("--robot", "--json"),
    "program check": ("--robot", "--site", "--json"),
    "record": ("--json",),
    "recordings list": ("--json",),
    "recordings info": ("--json",),
    "recordings recover": (),
    **dict.fromkeys(
        (f"recordings {each}" for each in ("rename", "note", "tag", "delete")),
        ("--connect", "--operator", "--json"),
    ),
    "recordings export": (),
    "recordings play": (),
    **dict.fromkeys(
        (f"programs {each}" for each in ("list", "show", "save", "rename", "delete", "restore", "import")),
        ("--connect", "--json"),
    ),
    "programs diff": ("--connect",),
    "programs export": ("--force",),
    "note": ("--from", "--to", "--withdraw", "--json"),
    "cell show": ("--json",),
    **dict.fromkeys((f"cell {each}" for each in ("set", "move", "undo")), ("--yes", "--dry-run", "--json")),
    "audit verify": ("--head", "--json"),
    "keys init": (),
    "doctor": ("--security", "--json"),
    "snapshot": (),
}  # fmt: skip


def command(words: str) -> click.Command:
    name, *rest = words.split()
    found = load(name)
    for word in rest:
        found = found.commands[word]
    return found


@pytest.mark.parametrize("name", COMMANDS)
def test_table_has_the_short_help_of_the_command(name: str) -> None:
    assert load(name).get_short_help_str(limit=1000) == COMMANDS[name].help


def imported_by(*words: str) -> set[str]:
    """Return the modules that a command imports."""
    script = (
        "import sys; from services.command_line.main import run\n"
        f"status = run({list(words)!r})\n"
        "sys.exit(' '.join(sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False, cwd=ROOT
    )
    return set(done.stderr.split())


@pytest.mark.slow
def test_help_imports_no_command_and_nothing_heavy() -> None:
    imported = imported_by("--help")
    rows = {f"services.command_line.{row.module}" for row in COMMANDS.values()}
    assert "services.command_line.commands" in imported
    assert not imported & {*rows, "zenoh", "numpy", "pydantic", "google"}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["robot", "shapes", "program", "recordings", "audit", "keys"])
def test_help_of_a_group_imports_only_that_group(name: str) -> None:
    imported = imported_by(name, "--help")
    rows = {f"services.command_line.{row.module}" for row in COMMANDS.values()}
    assert imported & rows == {f"services.command_line.{COMMANDS[name].module}"}
    assert not imported & {"numpy", "pinocchio", "cryptography"}


@pytest.mark.parametrize("words", CONTRACT)
def test_command_has_the_options_of_the_contract(words: str) -> None:
    options = {option for each in command(words).params for option in each.opts}
    # A router has no --connect: it takes its links from the site file.
    missing = set(CONTRACT[words]) - options - ({"--connect"} if words == "router" else set())
    assert not missing


def test_table_names_every_command_of_the_contract() -> None:
    document = SHARED / "design.md"
    if not document.is_file():
        pytest.skip("the contract is not here")
    table = document.read_text().split("## The command line")[1].split("\n\n")[2]
    rows = [row.split("|")[1] for row in table.splitlines()[2:] if row.startswith("|")]
    named = {word for row in rows for word in re.findall(r"`([a-z]+)", row)}
    assert named - {words.split()[0] for words in CONTRACT} == set()


def test_fk_and_ik_print_json_with_and_without_the_option(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import io

    for words in (["fk", "-"], ["fk", "-", "--json"], ["fk", "--json", "-"]):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b'{"joints": [0, 0, 0, 0, 0]}\n')))
        assert run(words) == 0
        found = json.loads(capsys.readouterr().out)
    pose = json.dumps({"pose": found["tool"], "task": "5d"}).encode() + b"\n"
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(pose)))
    assert run(["ik", "-", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["solutions"]
    assert run(["ik", "300", "0", "500", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) >= {"solutions", "residual_m", "residual_rad", "reason"}


@pytest.mark.slow
@pytest.mark.parametrize("example", ["check.py", "inverse.py"])
def test_example_without_arguments_prints_its_usage(example: str) -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / example)],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
    )
    assert done.returncode == 1
    assert done.stderr.startswith(f"usage: ./dev run python examples/{example} ")
    assert len(done.stderr.splitlines()) == 1


def test_simulator_beyond_loopback_names_its_own_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["simulate", "--listen", f"0.0.0.0:{free_port()}"]) == 2
    error = capsys.readouterr().err
    assert "--insecure" in error
    assert "tls = {" not in error


@pytest.mark.slow
def test_ctrl_c_during_imports_exits_with_130_and_no_traceback() -> None:
    script = (
        "import os, signal, sys\n"
        "class Finder:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'services.command_line.main':\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder())\n"
        "from services.command_line.start import main\n"
        "main()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, "list"], capture_output=True, text=True, check=False, cwd=ROOT
    )
    assert (done.returncode, done.stderr, done.stdout) == (130, "", "")


def test_entry_point_restores_the_handler_of_ctrl_c(monkeypatch: pytest.MonkeyPatch) -> None:
    from services.command_line import start

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(main, "main", lambda: None)
    start.main()
    assert signal.getsignal(signal.SIGINT) is before


def test_doctor_checks_the_packages_of_every_service_with_an_extra() -> None:
    from services.command_line.doctor import machine

    roles = {finding.what for finding in machine._extras()}
    assert roles >= {*(f"role {name}" for name in SERVICES), "part foxglove", "part ros2"} - {"role router"}
    # The names of the packages are right: this environment has them all.
    assert all(finding.ok for finding in machine._extras())


def test_doctor_distinguishes_a_running_site_from_another_program(router: str) -> None:
    from services.command_line.doctor import machine

    with socket.create_server(("127.0.0.1", 0)) as other:
        site = Site(
            site="hall",
            router=Router(listen=(router, "tcp/192.0.2.1:7447"), insecure=True),  # RFC 5737: never ours
            console=Console(listen=f"127.0.0.1:{other.getsockname()[1]}"),
        )
        found = {each.what: each for each in machine._addresses(site)}
    assert found[f"router's {router}"].text.endswith("is used by a running site")
    assert found["router's tcp/192.0.2.1:7447"].text == "192.0.2.1:7447 is not this machine's address now"
    assert not found["console's address"].ok
    assert f"process {os.getpid()} " in found["console's address"].text


def test_an_option_of_a_simulated_controller_can_be_repeated():
    codes = ["2=ABSOLUTE.DEG", "101=COMMAND:home"]
    given = [word for code in codes for word in ("--code", code)]
    assert command("simulate").make_context("simulate", given).params["code"] == codes
