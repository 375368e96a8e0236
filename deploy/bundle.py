"""A bundle: one file from which `./dev up` sets up a site on a machine without a network.

It holds the project's files, the built page, and what pip and uv download for one kind of machine and one
version of Python. The manifest has the SHA-256 sum of every file.
"""

import argparse
import hashlib
import json
import platform
import re
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Callable, Collection, Iterator
from pathlib import Path

from deploy.locked_parts import PARTS, ROOT, UNUSED, WITHOUT_WHEEL, requirements

# Only a folder that came from a bundle has it.
BUNDLE = ROOT / ".bundle"
MANIFEST = "manifest.json"
DIST = ROOT / "dist"
BUILT_PAGE = ROOT / "services" / "console" / "page"
# The newest C library that the wheels may need: RHEL 9 has it, Debian 12 and Ubuntu 24.04 have newer ones.
GLIBC = 34


def this_python() -> str:
    """Return the version of Python for which wheels are made."""
    return "{}.{}".format(*sys.version_info)


def options(arguments: list[str]) -> argparse.Namespace:
    """Parse the arguments of `./dev bundle`."""
    parser = argparse.ArgumentParser(
        prog="./dev bundle", description="Make one file for a machine without a network."
    )
    parser.add_argument(
        "--platform", choices=("x86_64", "aarch64"), default=platform.machine(), help="as this machine"
    )
    parser.add_argument(
        "--python", default=this_python(), metavar="3.N", help="the other machine's python3; as here"
    )
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}")
    chosen = parser.parse_args(arguments)
    if unknown := set(chosen.parts) - PARTS.keys():
        parser.error(f"no part {', '.join(sorted(unknown))}: choose from {', '.join(PARTS)}")
    if not re.fullmatch(r"3\.1[1-4]", chosen.python):
        parser.error(f"--python {chosen.python}: choose 3.11, 3.12, 3.13 or 3.14")
    return chosen


def make(chosen: argparse.Namespace, uv: Path, uv_pin: str, call: Callable[..., None]) -> Path:
    """Write the file and return its path.

    Args:
        uv: The installer, as a program.
        uv_pin: The installer, as a requirement.
        call: Runs a command; ends the program if it fails.
    """
    machine, python, parts = chosen.platform, chosen.python, sorted({"site", *chosen.parts})
    name = f"robomesh-{machine}-python{python}"
    target = DIST / f"{name}.tar"
    DIST.mkdir(exist_ok=True)
    left_out = UNUSED if machine == "x86_64" else UNUSED | WITHOUT_WHEEL
    with tempfile.TemporaryDirectory(dir=DIST) as folder:
        wheels = Path(folder)
        asked, exact = wheels / "asked.txt", wheels / "exact.txt"
        asked.write_text(requirements(parts, left_out))
        # pip would take this machine's Python for the other's.
        call(uv, "pip", "compile", "--quiet", "--no-deps", "--generate-hashes", "--no-annotate",
             "--no-header", "--no-python-downloads", "--only-binary", ":all:", "--python-version", python,
             "--python-platform", f"{machine}-manylinux_2_{GLIBC}",
             "--output-file", exact, asked)  # fmt: skip
        for wanted in (("--require-hashes", "--requirement", exact), (uv_pin,)):
            call(sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check",
                 "--no-deps", "--only-binary", ":all:", "--implementation", "cp", "--python-version", python,
                 *platform_tags(machine), "--dest", wheels, *wanted)  # fmt: skip
        asked.unlink()
        exact.unlink()
        files = {path.relative_to(ROOT): path for path in project_files()}
        files |= {BUNDLE.relative_to(ROOT) / path.name: path for path in sorted(wheels.iterdir())}
        manifest = wheels / MANIFEST
        sums = {str(inside): digest_of(path) for inside, path in files.items()}
        about = {"machine": machine, "python": python, "parts": parts, "files": sums}
        manifest.write_text(json.dumps(about, indent=1))
        files[BUNDLE.relative_to(ROOT) / MANIFEST] = manifest
        unfinished = wheels / target.name
        with tarfile.open(unfinished, "w") as archive:
            for inside, path in files.items():
                archive.add(path, Path(name) / inside, filter=without_owner)
        unfinished.replace(target)
    return target


def fault(parts: Collection[str], *, first: bool) -> str | None:
    """Return why this folder's bundle cannot be used here, in one line; None: it can.

    Args:
        parts: Parts to install.
        first: Compare every file with its sum: nothing is installed yet, and nothing was edited.
    """
    try:
        manifest = json.loads((BUNDLE / MANIFEST).read_text())
        machine, python, there, sums = (manifest[key] for key in ("machine", "python", "parts", "files"))
    except (OSError, ValueError, KeyError, TypeError):
        return f"the bundle is damaged: {BUNDLE.name}/{MANIFEST}. Copy and unpack it again."
    here = platform.machine(), this_python()
    if (machine, python) != here:
        return (
            f"this bundle is for {machine} and Python {python}, and this machine is {here[0]} with Python "
            f"{here[1]}. Make one with ./dev bundle --platform {here[0]} --python {here[1]}"
        )
    if missing := sorted(set(parts) - set(there)):
        return f"this bundle does not hold {', '.join(missing)}: {advice(missing)}"
    damaged = [name for name, expected in sums.items() if first and digest_of(ROOT / name) != expected]
    if damaged:
        return f"the bundle is damaged: {damaged[0]}. Copy and unpack it again."
    return None


def advice(missing: list[str]) -> str:
    """Return how to have parts that a bundle does not hold."""
    if set(missing) <= PARTS.keys():
        return f"make one with ./dev bundle {' '.join(missing)}, on a machine with a network"
    return "clone the project on a machine with a network"


def project_files() -> Iterator[Path]:
    """Yield the files under version control and the built page."""
    listed = subprocess.run(("git", "ls-files", "-z"), cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode:
        sys.exit("dev: a bundle is made in a clone, with git")
    for name in filter(None, listed.stdout.split("\0")):
        if (ROOT / name).is_file():
            yield ROOT / name
    yield from (path for path in sorted(BUILT_PAGE.rglob("*")) if path.is_file())


def platform_tags(machine: str) -> Iterator[str]:
    """Yield pip's options for all platforms with wheels that run on a machine."""
    for tag in (
        f"manylinux2014_{machine}",
        *(f"manylinux_2_{minor}_{machine}" for minor in range(GLIBC, 4, -1)),
    ):
        yield from ("--platform", tag)


def digest_of(path: Path) -> str | None:
    """Return the SHA-256 sum of a file; None if there is no such file."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


def without_owner(entry: tarfile.TarInfo) -> tarfile.TarInfo:
    """Remove this machine's user from an entry."""
    entry.uid = entry.gid = 0
    entry.uname = entry.gname = ""
    return entry
