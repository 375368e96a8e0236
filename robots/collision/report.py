"""What a check of an arm covers of itself, in words: for `robot check`."""

from typing import Any

import numpy as np

from robots.collision.geometry import surface
from robots.collision.link_pairs import plan_pairs
from robots.description import load
from robots.joints import FloatArray
from robots.kinematic_tree import tree_of

# Visual geometry that stands out by less is rounding [m].
_STANDS_OUT_M = 0.005
# Directions in which that is measured.
_DIRECTIONS = 400


def collision_report(model: str) -> dict[str, Any]:
    """What of an arm is not checked against itself, and what its collision geometry leaves out.

    Args:
        model: As `robots.description.load` takes it.

    Returns:
        `not_checked`: pairs of links and the reason. `touch_at_home`: pairs that touch at home as hulls, and
        how they are checked. `touch_elsewhere`: the same of pairs that touch only in other positions, but
        often. `stands_out`: by link, how far its visual geometry stands out of the hull of its
        collision geometry [m], if by more than 5 mm.

    Raises:
        MeshError: If a mesh cannot be read.
    """
    plan = plan_pairs(model, False, wait=True)
    links = [link for link in tree_of(load(model)).links if link.shapes and link.collision]
    ways = {link.name: _beyond(surface(link.shapes), surface(link.collision)) for link in links}
    return {
        "not_checked": [{"links": list(links), "reason": reason} for links, reason in plan.ignored],
        "touch_at_home": [{"links": list(links), "reason": text} for links, text in plan.refined],
        "touch_elsewhere": [{"links": list(links), "reason": text} for links, text in plan.elsewhere],
        "stands_out": {link: way for link, way in ways.items() if way > _STANDS_OUT_M},
    }


def _beyond(drawn: FloatArray, checked: FloatArray) -> float:
    """How far one surface stands out of the hull of another, in some hundred directions [m]."""
    directions = np.random.default_rng(0).standard_normal((_DIRECTIONS, 3))
    directions = np.concatenate([np.eye(3), -np.eye(3), directions])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reaches = [(each.reshape(-1, 3) @ directions.T).max(axis=0, initial=-np.inf) for each in (drawn, checked)]
    return float((reaches[0] - reaches[1]).max())
