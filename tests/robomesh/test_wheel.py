"""The wheel in an environment of its own: `docs/python.md` runs there, and is a typed program."""

import re
import signal
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import robomesh
from tests.site import ONE_ARM, running_site, wait_until

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]
UV = ROOT / ".tools" / "bin" / "uv"
DOCUMENT = ROOT / "docs" / "python.md"
WAIT_S = 120.0


def output(*command, folder=None):
    """Run a command to its end, without a word on standard error, and return its output."""
    done = subprocess.run(
        [str(word) for word in command], capture_output=True, text=True, cwd=folder, timeout=WAIT_S
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", folder], check=True, cwd=ROOT
    )
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel, tmp_path_factory):
    """Return the interpreter of a new environment with the wheel and its base dependencies."""
    python = tmp_path_factory.mktemp("environment") / "bin" / "python"
    output(UV, "venv", "--quiet", "--python", sys.executable, python.parents[1])
    locked = ("--constraint", ROOT / "requirements.lock")
    output(UV, "pip", "install", "--quiet", "--python", python, *locked, wheel)
    return python


@pytest.fixture(scope="module")
def router(tmp_path_factory):
    """Yield the address of a site's router whose arm can be controlled, with the recording "trial"."""
    robots = ONE_ARM.replace('"arm"', '"pt600"')
    with running_site(tmp_path_factory.mktemp("site"), robots=robots) as site:
        with robomesh.connect(site.router, timeout_s=20.0) as mesh:
            wait_until(
                lambda: any(each.last("description") and each.last("controller") for each in mesh.robots())
            )
            record(site, mesh.robot("pt600"))
        yield site.router


def record(site, robot):
    """Record some seconds."""
    arguments = ("record", "pt600", "--name", "trial", "--view", "-", "--connect", site.router)
    with subprocess.Popen([sys.executable, "-m", "services.command_line.main", *arguments]) as recording:
        try:
            for state in robot.topic("recording", on_stale="yield"):
                length_s = state.message.duration.ToNanoseconds() * 1e-9
                if state.message.open and state.message.name == "trial" and length_s > 3.0:
                    break
            recording.send_signal(signal.SIGINT)
            assert recording.wait(WAIT_S) == 0
        finally:
            recording.kill()


def program(folder, router=None):
    """Write the document's blocks as one program, connected to a router, into a folder of its own."""
    blocks = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    text = "\n".join(blocks)
    if router is not None:
        text = re.sub(r"connect(_async)?\(\)", rf"connect\1({router!r}, timeout_s=20.0)", text)
    folder.mkdir()
    path = folder / "document.py"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def empty(tmp_path):
    """Return a folder in which nothing of the checkout can be imported."""
    folder = tmp_path / "empty"
    folder.mkdir()
    return folder


def test_every_block_of_the_document_runs(python, router, tmp_path, empty):
    path = program(tmp_path / "program", router)
    assert output(python, "-I", "-W", "error", path, folder=empty)


@pytest.mark.parametrize("stubs", [False, True], ids=["without stubs", "with protobuf's stubs"])
def test_the_document_is_a_typed_program(python, tmp_path, empty, stubs):
    path = program(tmp_path / "program")
    options = ("--strict", "--config-file=", "--cache-dir", tmp_path / "cache")
    environment = ("--python-executable", sys.executable if stubs else python)
    output(sys.executable, "-I", "-m", "mypy", *options, *environment, path, folder=empty)


def test_the_wheel_holds_the_marker_of_types(wheel):
    assert "robomesh/py.typed" in zipfile.ZipFile(wheel).namelist()


def test_every_public_name_can_be_imported(python, empty):
    code = "import robomesh; from robomesh import *; print(*(set(robomesh.__all__) - set(globals())))"
    assert output(python, "-I", "-W", "error", "-c", code, folder=empty) == "\n"


def test_the_command_line_runs_without_extras(python, router, empty):
    listed = output(python.with_name("robomesh"), "list", "--connect", router, folder=empty)
    assert "pt600" in listed
