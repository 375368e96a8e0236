"""Collisions and clearances of an arm: with itself, fixtures and the other robots of its cell.

The bodies of a pair are named "<robot>/<link>" or "<fixture>". This package wraps coal.
"""

from robots.collision.cell import (
    Arm,
    Cell,
    build_cell,
    distances,
    missing_meshes,
    pending,
    unshaped,
    unshaped_moving,
)
from robots.collision.continuous import Along, Encounter, near_along
from robots.collision.distance import Nearest, outside_clearance, outside_nearest, own_contacts, own_nearest
from robots.collision.sampling import allowed_positions

__all__ = [
    "Along",
    "Arm",
    "Cell",
    "Encounter",
    "Nearest",
    "allowed_positions",
    "build_cell",
    "distances",
    "missing_meshes",
    "near_along",
    "outside_clearance",
    "outside_nearest",
    "own_contacts",
    "own_nearest",
    "pending",
    "unshaped",
    "unshaped_moving",
]
