"""Bodies of the Pt500 and Pt600, a five-joint arm with forks; nominal sizes from the D-H rows.

Each function returns a link's pieces in that link's frame [mm]. `s` is the scale: 1 for the Pt600.
"""

import numpy as np

from robots.library.parts import (
    CASTING,
    PAINT,
    RUBBER,
    STEEL,
    Piece,
    at,
    bolts,
    cheek,
    cover,
    drum,
    laid,
    motor,
    rounded_box,
    tapered,
    turned_piece,
)
from robots.shapes.geometry import FloatArray
from robots.shapes.solids import lofted, plate, rectangle, tube

# From x forward, y left, z up to the column's frame, which has x forward and y up.
_UPRIGHT = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def base(s: float, height: float) -> list[Piece]:
    """Return foot, pedestal and connector box; z up from the floor, `height` to the shoulder."""
    top = height - 168 * s
    foot = (CASTING, plate(rectangle(280 * s, 280 * s, 46 * s, steps=6), 0, 24 * s, 5 * s))
    pedestal = turned_piece(
        PAINT,
        [
            (0, 22 * s),
            (124 * s, 22 * s),
            (120 * s, 40 * s),
            (101 * s, 0.62 * top),
            (101 * s, top - 34 * s),
            (112 * s, top - 24 * s),
            (112 * s, top - 7 * s),
            (0, top - 7 * s),
        ],
        fillet=9 * s,
    )
    bearing = drum(STEEL, 104 * s, top - 9 * s, top - 1 * s, fillet=0)
    pieces = [foot, pedestal, bearing]
    for x in (-1, 1):
        for y in (-1, 1):
            corner = at(x * 112 * s, y * 112 * s)
            washer = drum(STEEL, 15 * s, 24 * s, 27 * s)
            pieces += laid([washer, *bolts(0.0, 1, 10 * s, 27 * s, 36 * s)], corner)
    for angle in np.radians([45, 135, 225, 315]):
        pieces += laid([_rib(s, top)], _about_z(float(angle)))
    box = rounded_box(CASTING, (84 * s, 116 * s, 92 * s), (-124 * s, 0, 72 * s), radius=10 * s, bevel=4 * s)
    pieces.append(box)
    for y, radius in ((-32, 15), (4, 15), (36, 11)):
        plug = [
            drum(STEEL, radius * s, -2 * s, 8 * s, fillet=1),
            drum(RUBBER, 0.74 * radius * s, 8 * s, 26 * s, fillet=2),
        ]
        pieces += laid(plug, at(-166 * s, y * s, 76 * s, axis="-x"))
    return pieces


def _rib(s: float, top: float) -> Piece:
    """Return a rib from the foot up to the pedestal, along x."""
    outline = np.array([[96 * s, 22 * s], [152 * s, 22 * s], [152 * s, 30 * s], [96 * s, 0.62 * top]])
    sides = [np.column_stack([outline[:, 0], np.full(4, y), outline[:, 1]]) for y in (5 * s, -5 * s)]
    return PAINT, lofted(sides)


def _about_z(angle: float) -> FloatArray:
    placement = np.eye(4)
    placement[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return placement


def column(s: float) -> list[Piece]:
    """Return turntable and fork up to the shoulder axis, with both motors."""
    upright: list[Piece] = [
        turned_piece(
            PAINT,
            [(0, -168 * s), (112 * s, -168 * s), (112 * s, -140 * s), (96 * s, -126 * s), (0, -126 * s)],
            fillet=6 * s,
        ),
        *bolts(102 * s, 12, 4.5 * s, -139 * s, -133 * s, start=15),
        (PAINT, _trunk(s)),
    ]
    # The waist's motor is behind the trunk.
    upright += laid(motor(44 * s, 0, 150 * s, fins=7), at(-84 * s, 0, -140 * s))
    pieces = laid(upright, _UPRIGHT)
    for side in (1, -1):
        low, high = (60 * s, 96 * s)
        plate_low, plate_high = (low, high) if side > 0 else (-high, -low)
        pieces.append(cheek(PAINT, (0, -72 * s), 74 * s, (0, 0), 73 * s, plate_low, plate_high, bevel=7 * s))
    pieces += laid(motor(60 * s, 0, 74 * s, fins=4), at(0, 0, 95 * s))
    pieces += laid(cover(60 * s, 0, 20 * s, count=8), at(0, 0, -95 * s, axis="-z"))
    return pieces


def _trunk(
    s: float,
) -> tuple[
    np.ndarray[tuple[int, int], np.dtype[np.float64]], np.ndarray[tuple[int, int], np.dtype[np.int64]]
]:
    """Return the transition from the round turntable to the square base of the fork, z up."""
    sections = []
    stations = [(-130, 184, 184, 91), (-124, 178, 186, 84), (-112, 168, 190, 62), (-98, 158, 192, 42)]
    stations += [(-86, 150, 192, 34), (-76, 146, 192, 32), (-71, 140, 186, 30), (-69, 132, 178, 28)]
    for z, along_x, along_y, radius in stations:
        flat = rectangle(along_x * s, along_y * s, radius * s, steps=8)
        sections.append(np.column_stack([flat, np.full(len(flat), z * s)]))
    return lofted(sections)


def upper_arm(s: float, length: float) -> list[Piece]:
    """Return the arm from the shoulder's hub to the elbow's fork; x along it, the elbow at the origin."""
    fork = length - 84 * s
    along: list[Piece] = [
        drum(PAINT, 66 * s, -57 * s, 57 * s, fillet=6 * s),
        drum(STEEL, 50 * s, -60 * s, 60 * s, fillet=0),
        tapered(
            PAINT,
            [
                (8 * s, 118 * s, 104 * s, 0),
                (70 * s, 104 * s, 100 * s, 0),
                (0.55 * length, 90 * s, 98 * s, 0),
                (fork - 30 * s, 86 * s, 116 * s, 0),
                (fork + 18 * s, 84 * s, 132 * s, 0),
            ],
            24 * s,
        ),
    ]
    for low, high in ((41 * s, 66 * s), (-66 * s, -41 * s)):
        along.append(cheek(PAINT, (fork, 0), 42 * s, (length, 0), 48 * s, low, high, bevel=5 * s))
    along += laid(motor(42 * s, 0, 58 * s, fins=4), at(length, 0, 65 * s))
    along += laid(cover(40 * s, 0, 14 * s), at(length, 0, -65 * s, axis="-z"))
    along += _conduit(s, length)
    return laid(along, at(-length))


def _conduit(s: float, length: float) -> list[Piece]:
    """Return the elbow motor's cable along the arm's side, in two clamps."""
    t = np.linspace(0, 1, 21)
    path = np.column_stack(
        [
            (62 + t * (length / s - 62)) * s,
            -6 * s * np.sin(np.pi * t),
            (47 + 24 * np.sin(np.pi * np.minimum(t * 1.35, 1.0) / 2) ** 2) * s,
        ]
    )
    clamps = [
        rounded_box(CASTING, (16 * s, 26 * s, 16 * s), (x, 0.0, z), radius=3 * s, bevel=2 * s)
        for x, z in ((0.36 * length, 55 * s), (0.62 * length, 62 * s))
    ]
    return [(RUBBER, tube(path[:-2], 6.5 * s, 10)), *clamps]


def forearm(s: float, length: float) -> list[Piece]:
    """Return the arm from the elbow's hub to the wrist's fork; x along it, the wrist at the origin."""
    fork = length - 62 * s
    along: list[Piece] = [
        drum(CASTING, 47 * s, -38 * s, 38 * s, fillet=4 * s),
        drum(STEEL, 36 * s, -41 * s, 41 * s, fillet=0),
        tapered(
            PAINT,
            [
                (12 * s, 82 * s, 70 * s, 0),
                (80 * s, 88 * s, 72 * s, 6 * s),
                (0.55 * length, 72 * s, 70 * s, 3 * s),
                (fork - 24 * s, 62 * s, 78 * s, 0),
                (fork + 12 * s, 60 * s, 92 * s, 0),
            ],
            18 * s,
        ),
    ]
    for low, high in ((28 * s, 46 * s), (-46 * s, -28 * s)):
        along.append(cheek(PAINT, (fork, 0), 30 * s, (length, 0), 34 * s, low, high, bevel=4 * s))
    along += laid(cover(30 * s, 0, 12 * s, count=5), at(length, 0, 45 * s))
    along += laid(cover(30 * s, 0, 12 * s, count=5), at(length, 0, -45 * s, axis="-z"))
    # The wrist's two motors are on the arm's back, clear of the upper arm when it folds.
    for z in (-21 * s, 21 * s):
        along += laid(motor(19 * s, 0, 112 * s, fins=6), at(210 * s, 46 * s, z, axis="-x"))
    along.append(rounded_box(CASTING, (22 * s, 30 * s, 84 * s), (212 * s, 38 * s, 0), radius=6 * s))
    return laid(along, at(-length))


def wrist(s: float) -> list[Piece]:
    """Return the pitch block: y along the pitch axis, z along the roll axis."""
    pieces = laid(
        [
            drum(CASTING, 33 * s, -26.5 * s, 26.5 * s, fillet=3 * s),
            drum(STEEL, 24 * s, -28 * s, 28 * s, fillet=0),
        ],
        at(axis="+y"),
    )
    body = turned_piece(
        PAINT,
        [
            (0, 0),
            (25 * s, 0),
            (25 * s, 34 * s),
            (38 * s, 46 * s),
            (38 * s, 78 * s),
            (33 * s, 82 * s),
            (0, 82 * s),
        ],
        fillet=5 * s,
    )
    lip = drum(RUBBER, 31 * s, 81 * s, 85 * s, fillet=0)
    return [*pieces, body, lip]


def flange(s: float, face: float) -> list[Piece]:
    """Return the tool flange: bolt circle, pilot bore and dowel; its face at z = `face`, the tool's frame."""
    low = 85 * s
    disc = turned_piece(
        STEEL,
        [
            (0, low),
            (24 * s, low),
            (24 * s, face - 16 * s),
            (37 * s, face - 13 * s),
            (37 * s, face),
            (14 * s, face),
            (14 * s, face - 7 * s),
            (0, face - 7 * s),
        ],
        fillet=1.6 * s,
    )
    holes: list[Piece] = []
    for angle in np.radians([45, 135, 225, 315]):
        place = at(26 * s * float(np.cos(angle)), 26 * s * float(np.sin(angle)), face)
        holes += laid([drum(RUBBER, 3.6 * s, -2.0, 0.35)], place)
    dowel = laid([drum(CASTING, 2.6 * s, -2.0, 3.0 * s)], at(26 * s, 0, face))
    # A mark on the rim, so that the roll is visible.
    mark = rounded_box(
        PAINT, (5 * s, 10 * s, 10 * s), (37.5 * s, 0, face - 6.5 * s), radius=1.5 * s, bevel=1 * s
    )
    return [disc, *holes, *dowel, mark]
