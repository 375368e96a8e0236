"""Placements of an arm's bodies at many positions, and how far they travel between them.

Vectorized, because Pinocchio computes one position per call and a path has thousands.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from robots.bodies.geometry import Body
from robots.collision.cell import Arm
from robots.kinematics.joints import FloatArray, JointType
from robots.kinematics.kinematic_tree import BASE, Tree
from robots.schema.poses import axis_rotation

# Largest distance that a body travels between two samples of a path.
SAMPLE_M = 0.005
# Largest change of a joint on a piece of a line [rad] or [m]. A full turn in one piece would look like rest.
_PIECE = 0.1
# Initial number of intervals of a piece.
_FEWEST = 4
# Pieces per batch.
_TOGETHER = 200
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def placements_along(arm: Arm, positions: FloatArray) -> FloatArray:
    """Return the (m, bodies, 4, 4) of an arm's bodies to the site [m].

    Args:
        positions: (m, n) [rad] or [m].
    """
    tree = arm.tree
    all_joints = _all_joints(tree, positions)
    to_site: list[FloatArray] = []
    for number, joint in enumerate(tree.joints):
        motion = np.tile(np.eye(4), (len(positions), 1, 1))
        along = all_joints[:, number]
        if joint.type is JointType.ROTARY:
            motion[:, :3, :3] = axis_rotation(np.tile(joint.axis, (len(positions), 1)), along)
        else:
            motion[:, :3, 3] = along[:, None] * joint.axis
        parent = arm.base_to_site if joint.parent == BASE else to_site[joint.parent]
        to_site.append(parent @ joint.joint_to_parent @ motion)
    placements = np.empty((len(positions), len(arm.bodies), 4, 4))
    for number, link in enumerate(tree.links[link] for link in arm.links.tolist()):
        joint_to_site = arm.base_to_site if link.joint == BASE else to_site[link.joint]
        placements[:, number] = joint_to_site @ link.link_to_joint
    return placements


def _all_joints(tree: Tree, positions: FloatArray) -> FloatArray:
    """Return the (m, all) positions of all joints, including mimic joints."""
    all_joints = np.empty((len(positions), len(tree.joints)))
    all_joints[:, list(tree.free)] = positions
    for number, joint in enumerate(tree.joints):
        if joint.mimic is not None:
            leader = all_joints[:, joint.mimic.leader]
            all_joints[:, number] = joint.mimic.multiplier * leader + joint.mimic.offset
    return all_joints


def corners_along(bodies: tuple[Body, ...], placements: FloatArray) -> FloatArray:
    """Return the (m, bodies, 8, 3) corners of each body's box, in the site's frame [m]."""
    found = np.empty((*placements.shape[:2], len(_CORNERS), 3))
    for number, body in enumerate(bodies):
        corners = body.center + _CORNERS * body.half
        rotations, origins = placements[:, number, :3, :3], placements[:, number, :3, 3]
        found[:, number] = corners @ rotations.swapaxes(1, 2) + origins[:, None]
    return found


def travelled(bodies: tuple[Body, ...], placements: FloatArray) -> FloatArray:
    """Return the (m, bodies) upper bound of the distance that a point of each body has travelled [m].

    Between two samples, a body is within half of their difference from one of them.
    """
    steps = np.zeros(placements.shape[:2])
    changes = np.diff(placements, axis=0)
    for number, body in enumerate(bodies):
        # In a rigid motion, no point of a box travels farther than its corners.
        corners = body.center + _CORNERS * body.half
        moved = changes[:, number, :3, :3] @ corners.T + changes[:, number, :3, 3:]
        steps[1:, number] = np.sqrt(np.einsum("mic,mic->mc", moved, moved).max(axis=1))
    return np.cumsum(steps, axis=0)


def pieces_of(lines: FloatArray) -> FloatArray:
    """Cut straight joint lines into short pieces.

    Args:
        lines: (k, 2, n) the lines' ends [rad] or [m].

    Returns:
        (p, 2, n) the pieces' ends.
    """
    pieces = [np.empty((0, *lines.shape[1:]))]
    for start, end in lines:
        count = max(int(np.ceil(np.abs(end - start).max() / _PIECE)), 1)
        ends = start + np.linspace(0.0, 1.0, count + 1)[:, None] * (end - start)
        pieces.append(np.stack([ends[:-1], ends[1:]], axis=1))
    return np.concatenate(pieces)


def boxes_of_pieces(arm: Arm, pieces: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the bounding box of each body on each piece, along the site's axes.

    Args:
        pieces: (p, 2, n) from `pieces_of`.

    Returns:
        (p, bodies, 3) lowest and highest corners [m].
    """
    ends = [corners_along(arm.bodies, placements_along(arm, pieces[:, end])) for end in (0, 1)]
    moves = np.abs(_all_joints(arm.tree, pieces[:, 1]) - _all_joints(arm.tree, pieces[:, 0])).sum(axis=1)
    farthest = max(np.linalg.norm(at - arm.base_to_site[:3, 3], axis=3).max(initial=0.0) for at in ends)
    # A point's second derivative is at most its distance from the rotating joint (or 1 m per metre of a
    # prismatic one). This bounds its deviation from the straight line between both ends.
    bulges = (max(2 * farthest, 1.0) * moves**2 / 8)[:, None, None]
    low = np.minimum(*(at.min(axis=2) for at in ends)) - bulges
    high = np.maximum(*(at.max(axis=2) for at in ends)) + bulges
    return low, high


def sampled_pieces(arm: Arm, pieces: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Sample pieces of straight joint lines so that no body travels more than SAMPLE_M between two samples.

    Args:
        pieces: (p, 2, n) from `pieces_of`.

    Yields:
        For each piece, (m, bodies, 4, 4) of the bodies to the site, and (m, bodies) travelled distances [m].
    """
    for begin in range(0, len(pieces), _TOGETHER):
        part = pieces[begin : begin + _TOGETHER]
        counts = np.full(len(part), _FEWEST)
        found: dict[int, tuple[FloatArray, FloatArray]] = {}
        while len(found) < len(part):
            wanted = [number for number in range(len(part)) if number not in found]
            shares = [np.linspace(0.0, 1.0, counts[number] + 1)[:, None] for number in wanted]
            lines = [
                part[number, 0] + share * (part[number, 1] - part[number, 0])
                for number, share in zip(wanted, shares, strict=True)
            ]
            placements = placements_along(arm, np.concatenate(lines))
            travel = travelled(arm.bodies, placements)
            first = 0
            for number, line in zip(wanted, lines, strict=True):
                here = slice(first, first + len(line))
                first += len(line)
                way = travel[here] - travel[here][0]
                farthest = np.diff(way, axis=0).max(initial=0.0)
                if farthest <= SAMPLE_M:
                    found[number] = placements[here], way
                else:
                    counts[number] = int(np.ceil(1.1 * counts[number] * farthest / SAMPLE_M))
        yield from (found[number] for number in range(len(part)))
