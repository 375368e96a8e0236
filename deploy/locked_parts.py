"""The parts of requirements.lock that a site, or a command of `./dev`, installs."""

import re
import tomllib
from collections.abc import Collection, Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LOCK = ROOT / "requirements.lock"
EXAMPLE_ROBOTS_LOCK = ROOT / "example-robots.lock"

# Extras that `up` leaves out, and how large they are installed.
PARTS = {
    "step": "the reader of STEP files, 99 MB",
    "dxf": "the reader of DXF files, 42 MB",
    "plots": "matplotlib, 60 MB",
    "foxglove": "the Foxglove bridge, 53 MB",
    "rerun": "Rerun and its viewer, 500 MB",
    "ros2": "the ROS 2 bridge, 20 MB",
}
# Locked apart, with no package that it asks for: it brings files only.
EXAMPLE_ROBOTS = "example-robots"
# Everything that requirements.lock names. Only this part holds the group dev.
BENCH = "bench"
SIZES = {
    "site": "what a site needs, 610 MB",
    **PARTS,
    EXAMPLE_ROBOTS: "robots to try, 131 MB",
    BENCH: "what the tests and checks need, 1.2 GB",
}
# `eaik` asks for these and what they bring, 200 MB, for readers that robomesh does not call.
UNUSED = {"scipy", "urchin"}
# They have no wheel for aarch64: a compiler builds them.
WITHOUT_WHEEL = {"moderngl", "ruckig"}


def plain(requirement: str) -> str:
    """Return the normal form of the name in a requirement."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def roots(parts: Iterable[str]) -> set[str]:
    """Return the packages that pyproject.toml asks for by name, for a site and these parts."""
    asked = tomllib.loads((ROOT / "pyproject.toml").read_text())
    extras, groups = asked["project"]["optional-dependencies"], asked["dependency-groups"]
    left_out = set() if BENCH in parts else PARTS.keys() - set(parts)
    names = set()

    def take(requirements: list[str]) -> None:
        for each in requirements:
            if own := re.fullmatch(r"robomesh\[(.*)\]", each):
                for extra in own[1].split(","):
                    if extra not in left_out:
                        take(extras[extra])
            else:
                names.add(plain(each))

    more = [f"robomesh[{part}]" for part in parts if part in PARTS]  # `all` leaves out some
    take([*asked["project"]["dependencies"], *groups["build"], "robomesh[all]", *more])
    if BENCH in parts:
        take([each for each in groups["dev"] if isinstance(each, str)])
    return names


def requirements(parts: Iterable[str], left_out: Collection[str] = UNUSED) -> str:
    """Return the lines of requirements.lock that a site and these parts need.

    The lock names the packages that ask for each package.

    Args:
        left_out: Packages that are not installed, and neither is what only they need.
    """
    blocks = re.split(r"\n(?=[^\s#])", LOCK.read_text())
    asking: dict[str, set[str]] = {}
    for block in blocks:  # a package has one for each version that some Python takes
        asking.setdefault(plain(block), set()).update(
            plain(each) for each in re.findall(r"# +(?:via +)?(\w\S*)", block) if each != "via"
        )
    wanted, more = set(), roots(parts).difference(left_out)
    while more:
        wanted |= more
        more = {name for name in asking.keys() - wanted - set(left_out) if asking[name] & wanted}
    apart = EXAMPLE_ROBOTS_LOCK.read_text() if EXAMPLE_ROBOTS in parts else ""
    return "\n".join((*(block for block in blocks if plain(block) in wanted), apart))
