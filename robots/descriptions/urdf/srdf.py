"""Reader of SRDF, which adds to a URDF a home position and pairs of links without a collision check.

Source: https://wiki.ros.org/srdf.
"""

import xml.etree.ElementTree as Xml
from pathlib import Path

from robots.descriptions.urdf.values import WrongElement, numbers
from robots.kinematics.kinematic_tree import Tree
from robots.schema.errors import DescriptionError
from robots.schema.xml_text import XmlError, read_xml

_MOST_BYTES = 4_000_000
# Usual names of a robot's home position, the preferred first.
_HOMES = ("home", "default", "arm_up", "half_sitting", "standing")


def srdf_beside(urdf: Path, robot: str) -> tuple[Path | None, str]:
    """Return the SRDF of a URDF's robot, and a note if a file was rejected because it names another robot.

    It is in the URDF's folder, or in `srdf` next to the URDF's folder `urdf` or `robots`. In order of
    preference: a file with the URDF's name; a file that names the robot; the only SRDF with the only URDF,
    if it names the robot's series, or no robot.
    """
    folders = [urdf.parent]
    # ROS packages keep the two in separate folders; files outside the package are not read.
    if urdf.parent.name in ("urdf", "robots"):
        folders.append(urdf.parent.parent / "srdf")
    found, only_files = [], []
    for folder in folders:
        try:
            here = sorted(folder.glob("*.srdf"))
            single = len(here) == 1 and len(list(urdf.parent.glob("*.urdf"))) == 1
        except OSError:
            continue
        found += here
        only_files += here if single else []
    for path in found:
        if path.stem == urdf.stem:
            return path, ""
    for path in sorted(found, key=lambda path: path.stem != robot):
        if _robot_name(path) == robot:
            return path, ""
    note = ""
    for path in only_files:
        named = _robot_name(path)
        if _may_be(named, robot):
            return path, ""
        note = f"{path.name}: is for the robot {named!r}; it is not used"
    return None, note


def _may_be(named: str, robot: str) -> bool:
    """Return whether an SRDF names no robot, this one, or its series: abb_irb2400 for abb_irb2400_12_155."""
    named, robot = named.casefold(), robot.casefold()
    return named in ("", robot) or robot.startswith((f"{named}_", f"{named}-"))


def _robot_name(path: Path) -> str:
    try:
        return read_xml(path.read_bytes())[0].get("name", "")
    except (OSError, XmlError):
        return ""


def ignored_beside(urdf: Path, robot: str, tree: Tree) -> tuple[list[tuple[tuple[str, str], str]], str]:
    """Return the pairs that a URDF's SRDF excludes, with the SRDF's name, and a note if it is unusable."""
    path, note = srdf_beside(urdf, robot)
    if path is None:
        return [], note
    try:
        if path.stat().st_size > _MOST_BYTES:
            return [], f"{path.name}: has more than {_MOST_BYTES:,} bytes, so it is not used"
        _, pairs = read_srdf(path.read_bytes(), path, tree)
    except (OSError, DescriptionError) as error:
        reason = error.problems[0] if isinstance(error, DescriptionError) else "cannot be read"
        return [], f"{path.name}: {reason}; it is not used"
    return [(pair, path.name) for pair in pairs], ""


def read_srdf(data: bytes | str, source: Path, tree: Tree) -> tuple[dict[str, float], list[tuple[str, str]]]:
    """Return home positions by joint name [rad] or [m], and excluded pairs, for joints and links of the tree.

    Pairs excluded because they never touched in samples (MoveIt's reason "Never") are not returned, so that
    they stay checked.

    Raises:
        DescriptionError: If it is not an SRDF.
    """
    try:
        root, _ = read_xml(data)
        return _home(root, tree), _ignored(root, tree)
    except (XmlError, WrongElement) as error:
        raise DescriptionError(source, [str(error)]) from None


def _home(root: Xml.Element, tree: Tree) -> dict[str, float]:
    states = {state.get("name", ""): state for state in root.findall("group_state")}
    state = next((states[name] for name in _HOMES if name in states), None)
    if state is None:
        return {}
    free = {tree.joints[number].name: tree.joints[number] for number in tree.free}
    home = {}
    for element in state.findall("joint"):
        joint = free.get(element.get("name", ""))
        # The seven numbers of a free-floating base are not a joint position.
        if joint is None or len(element.get("value", "").split()) != 1:
            continue
        (position,) = numbers(element, "value", 1, f"group_state joint {joint.name!r}", "")
        if joint.lower <= position <= joint.upper:
            home[joint.name] = position
    return home


def _ignored(root: Xml.Element, tree: Tree) -> list[tuple[str, str]]:
    links = {link.name for link in tree.links}
    pairs = []
    for element in root.findall("disable_collisions"):
        one, other = element.get("link1", ""), element.get("link2", "")
        if element.get("reason") == "Never":
            continue
        if one in links and other in links and one != other:
            pairs.append((one, other))
    return pairs
