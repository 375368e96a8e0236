"""What an arm touches, and how near it is: to itself, to fixtures, to the other robots of its cell.

Pairs are named "<robot>/<link>" or "<fixture>". Coal stays behind this package.
"""

from robots.collision.along import Along, Encounter, near_along
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
from robots.collision.nearest import (
    Nearest,
    outside_clearance,
    outside_nearest,
    own_contacts,
    own_nearest,
)
from robots.collision.sampling import (
    FEWEST,
    SAMPLES,
    Contact,
    LinkPair,
    Sampling,
    allowed_positions,
    sample_pairs,
)

__all__ = [
    "FEWEST",
    "SAMPLES",
    "Along",
    "Arm",
    "Cell",
    "Contact",
    "Encounter",
    "LinkPair",
    "Nearest",
    "Sampling",
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
    "sample_pairs",
    "unshaped",
    "unshaped_moving",
]
