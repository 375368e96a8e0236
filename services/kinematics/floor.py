"""Event for an arm that is below its floor at the start, with the line to write in the site file."""

from collections.abc import Mapping

import numpy as np

from robomesh.contract.messages import reason_message
from robomesh.schemas.robomesh_pb2 import Event
from robots.collision import Cell
from robots.collision.floor import floor_advice, heights_above
from robots.collision.path import placements_along
from robots.kinematics.joints import FloatArray


def floor_event(cell: Cell, robot: str, poses: Mapping[str, FloatArray]) -> Event | None:
    """Return an event that lists the poses in which an arm is below the floor, or None if there is none.

    Args:
        poses: (n,) joint positions [rad] or [m], by a phrase that names them: "at home".
    """
    if cell.floor is None or not poses:
        return None
    arm = cell.arms[robot]
    found = heights_above(cell.floor, arm, placements_along(arm, np.array([*poses.values()])))
    phrases, lowest = [], 0.0
    for phrase, heights in zip(poses, found.heights, strict=True):
        if len(heights) and heights.min() <= 0.0:
            link = arm.names[int(found.bodies[heights.argmin()])]
            phrases.append(f"{phrase} {link} is {-heights.min() * 1000:.0f} mm below the floor")
            lowest = min(lowest, float(heights.min()))
    if not phrases:
        return None
    assert cell.floor.height_m is not None
    height_m = cell.floor.height_m
    advice = floor_advice(cell.floor, height_m + lowest)
    return Event(
        severity=Event.Severity.WARNING,
        code="kinematics.floor",
        source="kinematics",
        text=f"{' and '.join(phrases)}: {advice}",
        reason=reason_message(advice),
        values={"floor_m": f"{height_m:.6g}", "lowest_m": f"{height_m + lowest:.6g}"},
    )
