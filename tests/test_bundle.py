"""A bundle, made of a real package: unpacked, damaged, and taken to another machine."""

import json
import platform
import re
import subprocess
import sys
from pathlib import Path

import pytest

from deploy import bundle
from deploy.locked_parts import LOCK

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[1]
UV = ROOT / ".tools" / "bin" / "uv"
WAIT_S = 120.0
# One small package in place of hundreds, and one in place of the installer.
PACKAGE, INSTALLER = "shellingham", "typing-extensions"


def locked(name):
    """Return the lines of requirements.lock of one package."""
    return re.search(rf"^{name}==.*?(?=\n\S|\Z)", LOCK.read_text(), re.MULTILINE | re.DOTALL)[0]


def call(*command):
    subprocess.run([str(word) for word in command], check=True, cwd=ROOT, timeout=WAIT_S)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a bundle for this machine."""
    folder = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bundle, "requirements", lambda *_: locked(PACKAGE))
        patch.setattr(bundle, "DIST", folder)
        patch.setattr(sys, "executable", sys._base_executable)  # as for `dev`: it has pip
        return bundle.make(bundle.options([]), UV, locked(INSTALLER).split()[0], call)


@pytest.fixture
def unpacked(made, tmp_path):
    call("tar", "--extract", "--file", made, "--directory", tmp_path)
    (folder,) = tmp_path.iterdir()
    return folder


def fault(folder, parts=("site",), *, first=True):
    """Return what an unpacked bundle's own program says."""
    code = f"from deploy.bundle import fault; print(fault({parts!r}, first={first}))"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True, timeout=WAIT_S
    )
    return done.stdout.removesuffix("\n")


def set_manifest(folder, **values):
    path = folder / ".bundle" / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | values))


def test_a_bundle_holds_the_project_the_built_page_and_the_packages(unpacked):
    assert fault(unpacked) == "None"
    assert (unpacked / "dev").stat().st_mode & 0o100
    assert not (unpacked / ".git").exists()
    page = unpacked / "services" / "console" / "page" / "index.html"
    assert page.stat().st_mtime == pytest.approx(
        (ROOT / page.relative_to(unpacked)).stat().st_mtime, abs=1e-3
    )
    wheels = {path.name.partition("-")[0] for path in (unpacked / ".bundle").glob("*.whl")}
    assert wheels == {PACKAGE, INSTALLER.replace("-", "_")}


@pytest.mark.parametrize(
    "name", [".bundle/*.whl", "robomesh/contract/topics.py", "services/console/page/index.html"]
)
def test_a_damaged_or_missing_file_is_named_before_the_first_installation(unpacked, name):
    path = next(iter(unpacked.glob(name)))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    expected = f"the bundle is damaged: {path.relative_to(unpacked)}. Copy and unpack it again."
    assert fault(unpacked) == expected
    assert fault(unpacked, first=False) == "None"  # later, people edit files
    path.unlink()
    assert fault(unpacked) == expected


def test_without_a_readable_manifest_a_bundle_is_damaged(unpacked):
    manifest = unpacked / ".bundle" / "manifest.json"
    for content in ("", "[]", "{}", '{"machine": 1'):
        manifest.write_text(content)
        assert fault(unpacked) == "the bundle is damaged: .bundle/manifest.json. Copy and unpack it again."


@pytest.mark.parametrize("other", [{"machine": "aarch65"}, {"python": "3.9"}])
def test_a_bundle_for_another_machine_or_python_says_so_and_how_to_make_one(unpacked, other):
    set_manifest(unpacked, **other)
    line, here = fault(unpacked), f"--platform {platform.machine()} --python {bundle.this_python()}"
    assert line.startswith(f"this bundle is for {other.get('machine', platform.machine())} and Python ")
    assert line.endswith(f"Make one with ./dev bundle {here}")


def test_a_part_that_a_bundle_lacks_is_named_with_the_command_that_makes_one(unpacked):
    assert fault(unpacked, ("site", "plots")).startswith(
        "this bundle does not hold plots: make one with ./dev bundle plots"
    )
    assert fault(unpacked, ("site", "bench")).startswith("this bundle does not hold bench: clone the project")


@pytest.mark.parametrize("arguments", [["nothing"], ["--python", "3.10"], ["--platform", "vax"]])
def test_what_cannot_be_bundled_is_rejected(arguments, capsys):
    with pytest.raises(SystemExit):
        bundle.options(arguments)
    assert "error: " in capsys.readouterr().err


def test_a_changed_page_is_reported_in_one_line_and_needs_no_network(unpacked):
    build = [sys.executable, "web/build_page.py"]
    current = subprocess.run(build, cwd=unpacked, capture_output=True, text=True, timeout=WAIT_S)
    assert (current.returncode, current.stderr) == (0, "")
    (unpacked / "web" / "src" / "app" / "app.tsx").touch()
    changed = subprocess.run(build, cwd=unpacked, capture_output=True, text=True, timeout=WAIT_S)
    assert changed.returncode == 2
    assert changed.stderr.startswith("page: this folder came from a bundle, without the packages")
    assert changed.stderr.count("\n") == 1
