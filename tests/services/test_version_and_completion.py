"""`--version`, `version`, `help`, hints for a mistyped command, and completion in a shell."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from robomesh.service.health import own_version
from services.command_line.commands import COMMANDS
from services.command_line.main import run
from tests.ports import free_port

PROGRAM = Path(sys.executable).with_name("robomesh")


@pytest.fixture
def gateway(router):
    """Yield a router with a gateway of two sites, which share the robot name `arm`."""
    script = """
import asyncio, sys
from robomesh.service.health import Served, present
from robomesh.wire.last_values import last_values
from robomesh.wire.session import SessionSettings, open_session

async def main():
    served = Served(service="gateway", present_for=(("a", "arm"), ("a", "left"), ("b", "arm")))
    async with open_session(SessionSettings(connect=(sys.argv[1],), wait_s=20.0)) as session:
        async with present(session, served):
            health = "robomesh/*/-/health/*"
            while len(await session.present()) < 3 or len(await last_values(session, health)) < 2:
                await asyncio.sleep(0.05)
            print("ready", flush=True)
            await asyncio.to_thread(sys.stdin.read)

asyncio.run(main())
"""
    with subprocess.Popen(
        [sys.executable, "-c", script, router], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "ready\n"
        yield router
        process.stdin.close()


def completed(*words, connect=""):
    """Return what the program offers to bash for the last word."""
    environment = {
        **os.environ,
        "COMP_WORDS": " ".join(("robomesh", *words)),
        "COMP_CWORD": str(len(words)),
        "_ROBOMESH_COMPLETE": "complete_bash",
    }
    if connect:
        environment["ROBOMESH_CONNECT"] = connect
    done = subprocess.run([PROGRAM], capture_output=True, text=True, env=environment, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.split()


def test_version_is_that_of_the_package(capsys):
    assert run(["--version"]) == 0
    assert run(["version"]) == 0
    assert capsys.readouterr().out == f"robomesh {own_version()}\n" * 2


@pytest.mark.slow
def test_version_of_everything_names_packages_and_the_services_on_the_mesh(gateway, capsys):
    assert run(["version", "--all", "--json", "--connect", gateway]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["packages"]["eclipse-zenoh"]
    assert found["packages"]["protobuf"]
    assert found["python"].startswith(".".join(map(str, sys.version_info[:3])))
    services = [(each["site"], each["service"], each["version"]) for each in found["services"]]
    assert services == [("a", "gateway", own_version()), ("b", "gateway", own_version())]


@pytest.mark.slow
def test_version_of_everything_without_a_mesh_says_so(capsys):
    nowhere = f"tcp/127.0.0.1:{free_port()}"
    assert run(["version", "--all", "--connect", nowhere]) == 0
    text = capsys.readouterr().out
    assert "\nPython 3." in text
    assert f"services: unknown: no router at {nowhere}" in text


def test_help_is_the_option_help(capsys):
    for words in (["help"], ["--help"]):
        assert run(words) == 0
    once, again = capsys.readouterr().out.split("Usage: ")[1:]
    assert once == again
    assert run(["help", "robot", "check"]) == 0
    assert capsys.readouterr().out.startswith("Usage: robomesh robot check ")


@pytest.mark.parametrize(
    ("words", "hint"),
    [
        ("lst", "No such command 'lst'. Did you mean 'list'? (see robomesh --help)"),
        ("--nope", "No such option: --nope (see robomesh --help)"),
        ("list --nope", "No such option: --nope (see robomesh list --help)"),
        ("robot shw", "No such command 'shw'. Did you mean 'show'? (see robomesh robot --help)"),
        ("robot import", "Missing argument 'FILE'. (see robomesh robot import --help)"),
    ],
)
def test_a_hint_names_a_command_that_exists(capsys, words, hint):
    assert run(words.split()) == 2
    assert capsys.readouterr().err == f"robomesh: {hint}\n"


def test_a_group_without_a_command_prints_its_help(capsys):
    assert run(["recordings"]) == 2
    assert capsys.readouterr().err.startswith("Usage: robomesh recordings ")


@pytest.mark.slow
def test_commands_and_options_are_completed():
    assert set(completed("")) == COMMANDS.keys()
    assert completed("mon") == ["monitor"]
    assert completed("recordings", "ex") == ["export"]
    assert {"--connect", "--keys", "--json"} <= set(completed("list", "--"))


@pytest.mark.slow
def test_robots_on_the_mesh_are_completed_with_their_site_where_the_name_needs_it(gateway):
    assert completed("monitor", "", connect=gateway) == ["a/arm", "b/arm", "left"]
    assert completed("monitor", "a/", connect=gateway) == ["a/arm", "a/left"]
    assert completed("send", "--connect", gateway, "l") == ["left"]


@pytest.mark.slow
def test_the_limit_of_time_ends_with_the_search_for_robots():
    # A slow exit used to be ended by the alarm.
    script = """
import signal, types
from services.command_line.terminal import completion, discovery
discovery.run = lambda found: (found.close(), set())[1]
completion.robot_names(types.SimpleNamespace(params={"connect": ""}), "")
print(signal.getitimer(signal.ITIMER_REAL)[0])
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "0.0\n"


@pytest.mark.slow
def test_without_a_router_no_robot_is_completed_and_nothing_is_said():
    assert completed("monitor", "", connect=f"tcp/127.0.0.1:{free_port()}") == []


@pytest.mark.slow
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_shown_for_the_shell(shell):
    environment = {**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    done = subprocess.run(
        [PROGRAM, "--show-completion", shell], capture_output=True, text=True, env=environment, check=True
    )
    assert f"_ROBOMESH_COMPLETE=complete_{shell}" in done.stdout
