"""The wheel in environments of its own: `docs/python.md` runs there, is a typed program, and a site runs."""

import re
import signal
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import pytest

import robomesh
from deploy.locked_parts import UNUSED
from tests.check_platforms import PYTHONS
from tests.ports import free_port
from tests.site import ONE_ARM, running_file, running_site, site_file, wait_until

pytestmark = [pytest.mark.long, pytest.mark.processes]

ROOT = Path(__file__).parents[2]
UV = ROOT / ".tools" / "bin" / "uv"
DOCUMENT = ROOT / "docs" / "python.md"
WAIT_S = 120.0
# Asks every command, in one process, for its help, and prints how many there are.
HELP = """
import contextlib, io
from services.command_line.commands import COMMANDS, load
from services.command_line.main import run

def paths(command, path):
    yield path
    for name, each in getattr(command, "commands", {}).items():
        yield from paths(each, [*path, name])

every = [path for name in COMMANDS for path in paths(load(name), [name])]
for path in every:
    with contextlib.redirect_stdout(io.StringIO()) as text:
        assert run([*path, "--help"]) == 0, path
    assert text.getvalue().startswith("Usage: robomesh " + " ".join(path)), path
print(len(every))
"""


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
def whole(wheel, tmp_path_factory):
    """Return the interpreter of a new environment with the wheel and all its roles."""
    python = tmp_path_factory.mktemp("whole") / "bin" / "python"
    output(UV, "venv", "--quiet", "--python", sys.executable, python.parents[1])
    locked = ("--constraint", ROOT / "requirements.lock", "--excludes", unused(python.parents[1]))
    output(UV, "pip", "install", "--quiet", "--python", python, *locked, f"{wheel}[all]")
    return python


def unused(folder):
    """Write the names of the packages that no role calls, 200 MB, into a file."""
    path = folder / "unused.txt"
    path.write_text("\n".join(UNUSED))
    return path


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


def test_every_command_has_help(whole, empty):
    assert int(output(whole, "-I", "-c", HELP, folder=empty)) > 60


def test_a_site_runs_in_a_folder_with_modules_of_the_same_names(whole, tmp_path, empty):
    for name in ("services", "robots", "numpy"):
        (empty / f"{name}.py").write_text("raise SystemExit('the wrong module')")
    router, console = f"tcp/127.0.0.1:{free_port()}", f"127.0.0.1:{free_port()}"
    path = site_file(tmp_path / "site", robots=ONE_ARM, router=router, console=console)
    robomesh_program = [str(whole.with_name("robomesh"))]
    with running_file(path, router, console, program=robomesh_program, folder=empty) as site:
        page = urllib.request.urlopen(site.console, timeout=WAIT_S).read().decode()
        script = re.search(r'src="/?(assets/[^"]+\.js)"', page)[1]
        assert urllib.request.urlopen(site.console + script, timeout=WAIT_S).status == 200

        def listed():
            return output(*robomesh_program, "list", "--connect", router, folder=empty)

        roles = ("console", "gateway", "kinematics", "player", "recorder", "router", "simulator", "watch")
        wait_until(lambda: all(role in listed() for role in roles), WAIT_S)
    assert not [line for line in site.log if "wrong module" in line or "Traceback" in line]


def test_the_classifiers_name_the_versions_of_python_that_are_checked(wheel):
    with zipfile.ZipFile(wheel) as archive:
        (metadata,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = archive.read(metadata).decode()
    assert re.findall(r"^Classifier: Programming Language :: Python :: (3\.\d+)$", text, re.MULTILINE) == [
        *PYTHONS
    ]
    assert "Classifier: Typing :: Typed" in text
    assert "License-Expression: Apache-2.0" in text
