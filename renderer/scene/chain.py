"""Placements of the links of a URDF at given joint positions, and the space that they can reach.

The published description is enough for both, so the renderer needs no robot model.
"""

import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from renderer.errors import ChainError
from robots.descriptions.urdf.values import WrongElement, numbers, origin
from robots.schema.poses import axis_rotation

FloatArray = NDArray[np.float64]

_SAMPLES = 600


@dataclass(frozen=True, eq=False)
class ChainJoint:
    """A joint of the chain; `kind` is the type in the URDF."""

    name: str
    kind: str
    parent: str
    child: str
    origin: FloatArray
    axis: FloatArray
    lower: float
    upper: float


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints in order from the root: a joint's parent link comes before its child link."""

    root: str
    joints: tuple[ChainJoint, ...]


def read_chain(urdf: str) -> Chain:
    """Return the chain of a URDF.

    Raises:
        ChainError: If it is not a URDF, or its joints are not connected.
    """
    try:
        robot = ElementTree.fromstring(urdf)
        waiting = [_joint(element) for element in robot.findall("joint")]
        links = [link.attrib["name"] for link in robot.findall("link")]
    except (ElementTree.ParseError, WrongElement, KeyError, ValueError) as error:
        raise ChainError(f"the description's URDF cannot be read: {error!r}") from None
    children = {joint.child for joint in waiting}
    roots = [link for link in links if link not in children]
    if len(roots) != 1:
        raise ChainError(f"the URDF has {len(roots)} root links ({', '.join(roots)}); it must have one")
    placed, ordered = {roots[0]}, list[ChainJoint]()
    while waiting:
        ready = [joint for joint in waiting if joint.parent in placed]
        if not ready:
            raise ChainError(f"the URDF's joint {waiting[0].name!r} is not connected to the root")
        ordered += ready
        placed |= {joint.child for joint in ready}
        waiting = [joint for joint in waiting if joint.parent not in placed or joint.child not in placed]
    return Chain(roots[0], tuple(ordered))


def placements(chain: Chain, positions: Mapping[str, float | FloatArray]) -> dict[str, FloatArray]:
    """Return (..., 4, 4) link to base by link; joints without a position are at 0.

    Args:
        positions: Positions by joint [rad] or [m]: numbers, or arrays of the same shape.
    """
    placed: dict[str, FloatArray] = {chain.root: np.eye(4)}
    for joint in chain.joints:
        motion = _motion(joint, np.asarray(positions.get(joint.name, 0.0)))
        placed[joint.child] = placed[joint.parent] @ joint.origin @ motion
    return placed


def reach(chain: Chain, points: Mapping[str, FloatArray]) -> FloatArray:
    """Return (n, 3) positions that link origins and points on links can reach, in the base frame [m].

    They are from a fixed random sample of joint positions within the limits, plus all joints at 0.

    Args:
        points: (k, 3) points by link, in the link's frame [m].
    """
    # The sample is denser near the limits, where an arm reaches farthest.
    shares = np.random.default_rng(0).beta(0.7, 0.7, (len(chain.joints), _SAMPLES))
    positions = {
        joint.name: np.append(joint.lower + share * (joint.upper - joint.lower), 0.0)
        for joint, share in zip(chain.joints, shares, strict=True)
    }
    seen = []
    for link, link_to_base in placements(chain, positions).items():
        here = np.concatenate([np.zeros((1, 3)), points.get(link, np.empty((0, 3)))])
        seen.append(np.einsum("...ij,kj->...ki", link_to_base[..., :3, :3], here))
        seen[-1] += link_to_base[..., None, :3, 3]
    return np.concatenate([each.reshape(-1, 3) for each in seen])


def _joint(element: ElementTree.Element) -> ChainJoint:
    name, kind = element.attrib["name"], element.attrib["type"]
    limit = element.find("limit")
    bounds = limit.attrib if limit is not None else {}
    full_turn = np.pi if kind == "continuous" else 0.0
    return ChainJoint(
        name=name,
        kind=kind,
        parent=_link(element, "parent"),
        child=_link(element, "child"),
        origin=origin(element, f"joint {name!r}"),
        axis=np.array(numbers(element.find("axis"), "xyz", 3, f"joint {name!r} axis", "1 0 0")),
        lower=float(bounds.get("lower", -full_turn)),
        upper=float(bounds.get("upper", full_turn)),
    )


def _link(element: ElementTree.Element, end: str) -> str:
    child = element.find(end)
    if child is None:
        raise ValueError(f"joint {element.attrib['name']!r} has no {end}")
    return child.attrib["link"]


def _motion(joint: ChainJoint, position: FloatArray) -> FloatArray:
    """Return the (..., 4, 4) motion of a joint at its positions, relative to its origin."""
    motion = np.tile(np.eye(4), (*position.shape, 1, 1))
    if joint.kind in ("revolute", "continuous"):
        motion[..., :3, :3] = axis_rotation(joint.axis, position)
    elif joint.kind == "prismatic":
        motion[..., :3, 3] = joint.axis * position[..., None]
    return motion
