"""Extras that an installation lacks: one line names the package and the command that installs it."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from deploy.locked_parts import PARTS
from robomesh import extras
from robots.checks.plot import plot_check
from robots.programs.dxf import DxfPath, program_from_dxf
from robots.schema.errors import SaveError, ShapeError
from robots.shapes.files.dxf import read_dxf
from robots.shapes.files.step import read_step

ROOT = Path(__file__).parents[2]


def test_every_extra_of_the_table_exists():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert {*extras.EXTRAS.values(), *extras.ADDED_IN_CHECKOUT} <= project["optional-dependencies"].keys()


def test_what_a_checkout_adds_is_what_dev_adds():
    assert PARTS.keys() == extras.ADDED_IN_CHECKOUT


@pytest.mark.parametrize(
    ("checkout", "extra", "command"),
    [
        (True, "step", "./dev add step"),
        (True, "renderer", "pip install 'robomesh[renderer]'"),
        (False, "step", "pip install 'robomesh[step]'"),
    ],
)
def test_a_checkout_adds_what_it_left_out(monkeypatch, checkout, extra, command):
    monkeypatch.setattr(extras, "_CHECKOUT", checkout)
    assert extras.install_command(extra) == command


def test_a_step_file_without_its_reader_is_rejected_with_the_command(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "cascadio", None)
    path = tmp_path / "box.step"
    path.write_text("ISO-10303-21;")
    with pytest.raises(ShapeError, match=r"needs the package cascadio, .* add step"):
        read_step(path)


@pytest.mark.parametrize("read", [read_dxf, lambda path: program_from_dxf(path, DxfPath())])
def test_a_dxf_file_without_its_reader_is_rejected_with_the_command(monkeypatch, tmp_path, read):
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    path = tmp_path / "box.dxf"
    path.write_text("0\nEOF\n")
    with pytest.raises(ShapeError, match=r"needs the package ezdxf, .* add dxf"):
        read(path)


def test_a_plot_without_matplotlib_is_rejected_with_the_command(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(SaveError, match=r"needs the package matplotlib, .* add plots"):
        plot_check(None, None, tmp_path / "check.svg", title="")


@pytest.mark.slow
@pytest.mark.parametrize(("command", "package"), [("foxglove", "foxglove"), ("ros2", "rosbags")])
def test_a_bridge_without_its_package_ends_with_the_command(command, package):
    # In a process of its own: here, an earlier test may have imported the bridge.
    code = (
        f"import sys; sys.modules[{package!r}] = None; "
        f"from services.command_line import main; sys.exit(main.run([{command!r}]))"
    )
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stderr) == (
        2,
        f"robomesh: this needs the package {package}, which is not installed: ./dev add {command}\n",
    )
