"""One URDF of all robots, for external viewers: links have the names of the frames, shapes have addresses.

Works on the URDF text only, without kinematics.
"""

import xml.etree.ElementTree as Xml
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from robomesh.recordings.series.values import fixed_angles

ShapeUri = Callable[[str], str | None]

# The frame above the frames of several sites.
WORLD = "robomesh"
# Margin of a floor around the robots on it, and its drawn thickness [m].
_FLOOR_M = 1.6
_PLATE_M = 0.004


@dataclass(frozen=True)
class Fixture:
    """A fixture of a robot's cell.

    Attributes:
        pose: Fixture to site, 16 numbers by rows.
        uri: Address of the shape; None: no shape.
        color: "r g b a", each 0 to 1; empty: the shape's own.
    """

    name: str
    pose: Sequence[float]
    uri: str | None
    color: str = ""


@dataclass(frozen=True)
class Viewed:
    """A robot to show.

    Attributes:
        urdf: The URDF of its description, with links without a prefix.
        base_to_site: 16 numbers by rows.
        shape_uri: Returns the address of a link's shape by the link's name, or None without a shape.
        fixtures: Fixtures of its cell, the same for all robots of the cell.
        floor_m: Height of its cell's floor in the site's frame [m]; None: no floor.
    """

    site: str
    robot: str
    urdf: str
    base_to_site: Sequence[float]
    shape_uri: ShapeUri
    fixtures: tuple[Fixture, ...] = ()
    floor_m: float | None = None


def prefixed(urdf: str, prefix: str, shape_uri: ShapeUri, *, prefix_joints: bool = False) -> Xml.Element:
    """Return a URDF with prefixed link names, in which each link shows its shape only, in its colour.

    Args:
        prefix: Prefix of the links, `<site>/<robot>/`.
        prefix_joints: Also prefix the joints.

    Raises:
        ValueError: If it is not XML.
    """
    try:
        root = Xml.fromstring(urdf)
    except Xml.ParseError as error:
        raise ValueError(f"is not a URDF: {error}") from None
    for link in root.iter("link"):
        name = link.get("name", "")
        link.set("name", prefix + name)
        color = link.find("visual/material/color")
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
        _show(link, shape_uri(name), "" if color is None else color.get("rgba", ""))
    for end in (*root.iter("parent"), *root.iter("child")):
        end.set("link", prefix + end.get("link", ""))
    if prefix_joints:
        for joint in root.findall("joint"):
            joint.set("name", prefix + joint.get("name", ""))
            for mimic in joint.findall("mimic"):
                mimic.set("joint", prefix + mimic.get("joint", ""))
    return root


def without_joints(robot: Xml.Element) -> Xml.Element:
    """Return a robot with its links that have a shape, for a viewer that gets their placements as frames.

    Foxglove and Lichtblick place links by the URDF's joints too, at zero, until the next frames arrive: in a
    paused recording, never. Without joints they cannot show a pose that the robot does not have.
    """
    for element in list(robot):
        if element.tag == "joint" or (element.tag == "link" and element.find("visual") is None):
            robot.remove(element)
    return robot


def together(robots: Iterable[Viewed], *, joints: Literal["prefixed", "plain", "none"]) -> str:
    """Return one URDF of all robots at their places in their sites; invalid URDFs are left out.

    The root is the site's frame, or `WORLD` for several sites: their relative placement is unknown.

    Args:
        joints: "plain": they keep their names, for a single robot; "none": see `without_joints`.
    """
    whole = Xml.Element("robot", name=WORLD)
    known = list(robots)
    sites = sorted({robot.site for robot in known})
    if len(sites) > 1:
        Xml.SubElement(whole, "link", name=WORLD)
    for site in sites:
        Xml.SubElement(whole, "link", name=site)
        if len(sites) > 1:
            _fixed(whole, WORLD, site)
    fixtures = {(robot.site, each.name): each for robot in known for each in robot.fixtures}
    for (site, name), fixture in sorted(fixtures.items(), key=lambda each: each[0]):
        _show(Xml.SubElement(whole, "link", name=f"{site}/{name}"), fixture.uri, fixture.color)
        _fixed(whole, site, f"{site}/{name}", fixture.pose)
    _add_floors(whole, known)
    for robot in known:
        prefix = f"{robot.site}/{robot.robot}/"
        try:
            root = prefixed(robot.urdf, prefix, robot.shape_uri, prefix_joints=joints == "prefixed")
        except ValueError:
            continue
        if joints == "none":
            whole.extend(without_joints(root).findall("link"))
            continue
        children = {end.get("link") for end in root.iter("child")}
        whole.extend(element for element in root if element.tag in ("link", "joint"))
        for link in root.findall("link"):
            if link.get("name") not in children:
                _fixed(whole, robot.site, link.get("name", ""), robot.base_to_site)
    return Xml.tostring(whole, encoding="unicode")


def _add_floors(whole: Xml.Element, robots: Sequence[Viewed]) -> None:
    """Add a plate for each site and floor height, below all its robots; the upper side is the floor."""
    floors: dict[tuple[str, float], list[Sequence[float]]] = {}
    for robot in robots:
        if robot.floor_m is not None and len(robot.base_to_site) == 16:
            floors.setdefault((robot.site, robot.floor_m), []).append(robot.base_to_site)
    for number, ((site, height), bases) in enumerate(sorted(floors.items())):
        # A fixture's name cannot contain a full stop, so the names cannot clash.
        name = f"{site}/floor.{number}"
        x, y = ([base[column] for base in bases] for column in (3, 7))
        link = Xml.SubElement(whole, "link", name=name)
        visual = Xml.SubElement(link, "visual")
        size = f"{max(x) - min(x) + 2 * _FLOOR_M:.9g} {max(y) - min(y) + 2 * _FLOOR_M:.9g} {_PLATE_M:.9g}"
        Xml.SubElement(Xml.SubElement(visual, "geometry"), "box", size=size)
        Xml.SubElement(Xml.SubElement(visual, "material", name="floor"), "color", rgba="0.55 0.58 0.6 1")
        middle = (max(x) + min(x)) / 2, (max(y) + min(y)) / 2, height - _PLATE_M / 2
        pose = [
            1.0,
            0.0,
            0.0,
            middle[0],
            0.0,
            1.0,
            0.0,
            middle[1],
            0.0,
            0.0,
            1.0,
            middle[2],
            0.0,
            0.0,
            0.0,
            1.0,
        ]
        _fixed(whole, site, name, pose)


def _show(link: Xml.Element, uri: str | None, color: str) -> None:
    if uri:
        visual = Xml.SubElement(link, "visual")
        Xml.SubElement(Xml.SubElement(visual, "geometry"), "mesh", filename=uri)
        if color:
            material = Xml.SubElement(visual, "material", name=f"{link.get('name')} color")
            Xml.SubElement(material, "color", rgba=color)


def _fixed(whole: Xml.Element, parent: str, child: str, pose: Sequence[float] = ()) -> None:
    joint = Xml.SubElement(whole, "joint", name=f"{child}_in_{parent}", type="fixed")
    if len(pose) == 16:
        x, y, z = pose[3], pose[7], pose[11]
        roll, pitch, yaw = fixed_angles(pose)
        Xml.SubElement(
            joint, "origin", xyz=f"{x:.9g} {y:.9g} {z:.9g}", rpy=f"{roll:.9g} {pitch:.9g} {yaw:.9g}"
        )
    Xml.SubElement(joint, "parent", link=parent)
    Xml.SubElement(joint, "child", link=child)
