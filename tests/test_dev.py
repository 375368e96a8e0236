"""Verdict of `./dev test` on tests that pass only when repeated: it names them, and too many fail the run."""

import sys
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

PYTEST = (sys.executable, "-m", "pytest", "-q", "-p", "no:xdist")
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
def judged(dev, tmp_path, capfd):
    """Return why a folder of tests failed, and the tests that are named as unsteady."""

    def judge(text):
        (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers = other\n")
        (tmp_path / "test_it.py").write_text(TESTS + text)
        why = dev.run_parts(PYTEST, PARTS, tmp_path)
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


def test_tests_that_cannot_be_collected_fail_the_run(judged):
    why, _ = judged("import nothing_of_that_name\n")
    assert why == "dev: the tests could not be run; see above"
