"""Check that roles install from wheels, without a compiler: `./dev check` runs it.

Usage: check_platforms.py UV

It resolves for every machine and version of Python in docs/deploy.md, with the versions of requirements.lock.
"""

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLATFORMS = ("x86_64", "aarch64")
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
# `all` holds the exceptions; robots to try are locked apart.
NOT_CHECKED = {"all", "example-robots"}
# Extras that lack a wheel, as docs/deploy.md says.
EXCEPTIONS: dict[str, set[str]] = {"x86_64": set(), "aarch64": {"simulator", "renderer"}}
# They run next to the arms, where no OpenGL is.
SMALL = ("router", "gateway", "recorder")
OPEN_GL = {"glcontext", "moderngl", "pyglet", "pyopengl"}
TIME_LIMIT_S = 300.0


def resolve(uv: str, extras: Iterable[str], platform: str, python: str) -> tuple[set[str], str]:
    """Return the names of the packages that these extras install, and why they cannot be installed."""
    wanted = [word for extra in extras for word in ("--extra", extra)]
    # Without --no-python-downloads, uv tries to download that Python for half a minute.
    done = subprocess.run(
        [uv, "pip", "compile", "--quiet", "--no-header", "--no-annotate", "--no-python-downloads",
         "--only-binary", ":all:", "--constraint", "requirements.lock", *wanted,
         "--python-platform", f"{platform}-manylinux_2_34", "--python-version", python, "pyproject.toml"],
        cwd=ROOT, capture_output=True, text=True, timeout=TIME_LIMIT_S, check=False,
    )  # fmt: skip
    if done.returncode:
        return set(), " ".join(done.stderr.split())
    return set(re.findall(r"^[\w-]+", done.stdout, re.MULTILINE)), ""


def problems(uv: str, platform: str, python: str) -> list[str]:
    """Return what does not install on a platform with a version of Python."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    rest = extras.keys() - NOT_CHECKED - EXCEPTIONS[platform]
    small, small_failure = resolve(uv, SMALL, platform, python)
    _, rest_failure = resolve(uv, rest, platform, python)
    found = {small_failure, rest_failure} - {""}
    if open_gl := small & OPEN_GL:
        found.add(f"{', '.join(SMALL)} install {', '.join(sorted(open_gl))}")
    return [f"{platform}, Python {python}: {problem}" for problem in sorted(found)]


def main(uv: str) -> int:
    """Print the problems, and return 1 if there are any."""
    with ThreadPoolExecutor(4) as pool:
        found = pool.map(lambda place: problems(uv, *place), product(PLATFORMS, PYTHONS))
    lines = [line for each in found for line in each]
    print("\n".join(lines) or "every role installs from wheels, where docs/deploy.md says so")
    return 1 if lines else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
