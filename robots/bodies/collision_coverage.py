"""Report on the coverage of an arm's self-collision check, for `robot check`."""

from typing import Any

import numpy as np

from robots.bodies.geometry import surface
from robots.bodies.link_pairs import plan_pairs
from robots.descriptions.description import load
from robots.kinematics.joints import FloatArray
from robots.kinematics.kinematic_tree import tree_of

# Visual geometry that protrudes by less is not reported [m].
_STANDS_OUT_M = 0.005
# Directions to measure in.
_DIRECTIONS = 400


def collision_coverage(model: str) -> dict[str, Any]:
    """Return the unchecked link pairs of an arm, and gaps in its collision geometry.

    Args:
        model: Source for `robots.descriptions.description.load`.

    Returns:
        `not_checked`: link pairs and the reason. `touch_at_home`: pairs of which the hulls touch at home, and
        how they are checked. `touch_elsewhere`: the same for pairs of which the hulls often touch in other
        positions. `stands_out`: by link, the distance [m] by which its visual geometry protrudes from the
        hull of its collision geometry, if over 5 mm.

    Raises:
        ShapeError: If a shape cannot be read.
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
    """Return by how much one surface protrudes from the hull of another, over _DIRECTIONS directions [m]."""
    directions = np.random.default_rng(0).standard_normal((_DIRECTIONS, 3))
    directions = np.concatenate([np.eye(3), -np.eye(3), directions])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reaches = [(each.reshape(-1, 3) @ directions.T).max(axis=0, initial=-np.inf) for each in (drawn, checked)]
    return float((reaches[0] - reaches[1]).max())
