"""Where the bodies of an arm are at many positions at once, and how far they get from one to the next.

Pinocchio answers for one position a call; a path has thousands.
"""

from collections.abc import Iterator
from itertools import product

import numpy as np

from robots.collision.cell import Arm
from robots.collision.geometry import Body
from robots.joints import FloatArray, JointType
from robots.kinematic_tree import BASE, Tree
from robots.poses import axis_rotation

# No body moves farther between two samples of a path.
SAMPLE_M = 0.005
# No joint goes farther on a piece of a line [rad] or [m]: none turns once round, and seems to stand.
_PIECE = 0.1
# In how many parts a piece is cut at first.
_FEWEST = 4
# So many pieces are sampled together.
_TOGETHER = 200
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def placements_along(arm: Arm, positions: FloatArray) -> FloatArray:
    """(m, bodies, 4, 4) of an arm's bodies to the site [m].

    Args:
        positions: (m, n) [rad] or [m].
    """
    tree = arm.tree
    everywhere = _everywhere(tree, positions)
    to_site: list[FloatArray] = []
    for number, joint in enumerate(tree.joints):
        motion = np.tile(np.eye(4), (len(positions), 1, 1))
        along = everywhere[:, number]
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


def _everywhere(tree: Tree, positions: FloatArray) -> FloatArray:
    """(m, all) positions of all joints, also of those that follow others."""
    everywhere = np.empty((len(positions), len(tree.joints)))
    everywhere[:, list(tree.free)] = positions
    for number, joint in enumerate(tree.joints):
        if joint.mimic is not None:
            leader = everywhere[:, joint.mimic.leader]
            everywhere[:, number] = joint.mimic.multiplier * leader + joint.mimic.offset
    return everywhere


def corners_along(bodies: tuple[Body, ...], placements: FloatArray) -> FloatArray:
    """(m, bodies, 8, 3) the corners of each body's box, in the site's frame [m]."""
    found = np.empty((*placements.shape[:2], len(_CORNERS), 3))
    for number, body in enumerate(bodies):
        corners = body.center + _CORNERS * body.half
        rotations, origins = placements[:, number, :3, :3], placements[:, number, :3, 3]
        found[:, number] = corners @ rotations.swapaxes(1, 2) + origins[:, None]
    return found


def travelled(bodies: tuple[Body, ...], placements: FloatArray) -> FloatArray:
    """(m, bodies) how far each body has come since the first sample, at most, at its fastest point [m].

    What is between two samples is farther from neither than half of their difference.
    """
    steps = np.zeros(placements.shape[:2])
    # A body moves rigidly: no point of its box moves farther than its corners do.
    moved = np.diff(corners_along(bodies, placements), axis=0)
    steps[1:] = np.sqrt((moved * moved).sum(axis=3).max(axis=2))
    return np.cumsum(steps, axis=0)


def pieces_of(lines: FloatArray) -> FloatArray:
    """Straight joint lines cut into short pieces.

    Args:
        lines: (k, 2, n) their ends [rad] or [m].

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
    """What holds each body on each piece, along the site's axes.

    Args:
        pieces: (p, 2, n) as of `pieces_of`.

    Returns:
        (p, bodies, 3) lowest and highest corners [m].
    """
    ends = [corners_along(arm.bodies, placements_along(arm, pieces[:, end])) for end in (0, 1)]
    moves = np.abs(_everywhere(arm.tree, pieces[:, 1]) - _everywhere(arm.tree, pieces[:, 0])).sum(axis=1)
    farthest = max(np.linalg.norm(at - arm.base_to_site[:3, 3], axis=3).max(initial=0.0) for at in ends)
    # Where a point is bends by no more than its distance from the joint that turns it (or by 1 m for each
    # metre of a sliding one): so far it may leave the straight line between both ends.
    bulges = (max(2 * farthest, 1.0) * moves**2 / 8)[:, None, None]
    low = np.minimum(*(at.min(axis=2) for at in ends)) - bulges
    high = np.maximum(*(at.max(axis=2) for at in ends)) + bulges
    return low, high


def sampled_pieces(arm: Arm, pieces: FloatArray) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Pieces of straight joint lines, sampled so that no body moves more than SAMPLE_M between two samples.

    Args:
        pieces: (p, 2, n) as of `pieces_of`.

    Returns:
        Of each piece (m, bodies, 4, 4) of the bodies to the site, and (m, bodies) how far they have come [m].
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
            come = travelled(arm.bodies, placements)
            first = 0
            for number, line in zip(wanted, lines, strict=True):
                here = slice(first, first + len(line))
                first += len(line)
                way = come[here] - come[here][0]
                farthest = np.diff(way, axis=0).max(initial=0.0)
                if farthest <= SAMPLE_M:
                    found[number] = placements[here], way
                else:
                    counts[number] = int(np.ceil(1.1 * counts[number] * farthest / SAMPLE_M))
        yield from (found[number] for number in range(len(part)))


def sampled_path(arm: Arm, path: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A path of straight joint lines, sampled so that no body moves more than SAMPLE_M between two samples.

    Args:
        path: (k, n) the lines' ends [rad] or [m].

    Returns:
        (m, bodies, 4, 4) of the bodies to the site, and (m, bodies) how far they have come [m].
    """
    lines = np.stack([path[:-1], path[1:]], axis=1)
    pieces = [placements[1:] for placements, _ in sampled_pieces(arm, pieces_of(lines))]
    placements = np.concatenate([placements_along(arm, path[:1]), *pieces])
    return placements, travelled(arm.bodies, placements)
