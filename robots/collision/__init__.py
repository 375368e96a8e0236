"""Collisions and clearances of an arm: with itself, fixtures and the other robots of its cell.

The bodies of a pair are named "<robot>/<link>" or "<fixture>". This package wraps coal.
"""

from robots.bodies.sampling import allowed_positions
from robots.collision.cell import (
    Arm,
    Cell,
    build_cell,
    distances,
    missing_shapes,
    pending,
    unshaped,
    unshaped_moving,
)
from robots.collision.continuous import Encounter, PathEncounters, path_encounters
from robots.collision.distance import Nearest, outside_clearance, outside_nearest, own_contacts, own_nearest

__all__ = [
    "Arm",
    "Cell",
    "Encounter",
    "Nearest",
    "PathEncounters",
    "allowed_positions",
    "build_cell",
    "distances",
    "missing_shapes",
    "outside_clearance",
    "outside_nearest",
    "own_contacts",
    "own_nearest",
    "path_encounters",
    "pending",
    "unshaped",
    "unshaped_moving",
]
