"""Bodies of the Puma 560 in its link frames [mm]: trunk, shoulder drum, wide upper arm, slim wrist."""

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
from robots.shapes.solids import plate, rectangle, strap

_A2, _A3 = 431.8, -20.3  # lengths of the D-H rows of shoulder and elbow


def base() -> list[Piece]:
    """Return foot, trunk and connector box; z up from the floor."""
    foot = (CASTING, plate(rectangle(350, 350, 60, steps=6), 0, 26, 5))
    trunk = turned_piece(
        PAINT,
        [(0, 24), (150, 24), (146, 44), (98, 96), (88, 170), (88, 520), (97, 532), (97, 566), (0, 566)],
        fillet=16,
    )
    pieces = [foot, trunk, drum(STEEL, 90, 564, 573, fillet=0)]
    for x in (-1, 1):
        for y in (-1, 1):
            washer = drum(STEEL, 19, 26, 29)
            pieces += laid([washer, *bolts(0.0, 1, 12, 29, 40)], at(x * 140, y * 140))
    pieces.append(rounded_box(CASTING, (110, 130, 250), (-112, 0, 190), radius=14, bevel=5))
    for z in (110, 160, 210):
        plug = [drum(STEEL, 20, -2, 9, fillet=1), drum(RUBBER, 15, 9, 32, fillet=2)]
        pieces += laid(plug, at(-166, 0, z, axis="-x"))
    for z in (150, 300, 450):
        pieces.append(turned_piece(CASTING, [(86, z - 2), (90, z - 2), (90, z + 2), (86, z + 2)]))
    return pieces


def column() -> list[Piece]:
    """Return the neck and the shoulder's drum; z along the shoulder's axis, y down."""
    neck = laid(
        [
            turned_piece(PAINT, [(0, -86), (95, -86), (95, -58), (84, -46), (84, 0), (0, 0)], fillet=8),
            *bolts(89, 10, 4, -58, -52, start=18),
        ],
        at(axis="-y"),
    )
    body = drum(PAINT, 86, -118, 148, fillet=8)
    rear = laid(cover(80, 0, 22, count=8), at(0, 0, -117, axis="-z"))
    ring = drum(STEEL, 74, 147, 156, fillet=0)
    return [*neck, body, *rear, ring]


def upper_arm() -> list[Piece]:
    """Return the arm next to the shoulder's drum; x along the arm, elbow at the origin, z off the trunk."""
    low, high = 48.0, 132.0
    outline = strap(np.array([-_A2, 0.0]), 104, np.zeros(2), 64, 56)
    rear = strap(np.array([-_A2 - 150, 0.0]), 76, np.array([-_A2, 0.0]), 104, 56)
    pieces: list[Piece] = [
        (PAINT, plate(outline, low, high, 12, steps=4)),
        (PAINT, plate(rear, low, high, 12, steps=4)),
    ]
    pieces += laid([drum(STEEL, 76, -14, 29, fillet=0), drum(PAINT, 84, 28, 52, fillet=4)], at(-_A2, 0, 0))
    pieces += laid(cover(72, 0, 16, count=8), at(-_A2, 0, high - 1))
    pieces += laid(cover(46, 0, 14, count=6), at(0, 0, high - 1))
    pieces += [drum(STEEL, 48, 42, 50)]
    # The cover of the two motors in the arm's back, and the long one between the axes.
    back = strap(np.array([-_A2 - 150, 0.0]), 54, np.array([-_A2 - 112, 0.0]), 56, 40)
    middle = strap(np.array([-_A2 + 128, 0.0]), 52, np.array([-104.0, 0.0]), 38, 40)
    for panel in (back, middle):
        pieces.append((CASTING, plate(panel, high - 2, high + 4, 2)))
    for x in (-_A2 + 110, -_A2 + 146, -112, -84):
        pieces += laid(bolts(0.0, 1, 4.5, high + 3, high + 7), at(x + 12, 0, 0))
    for y in (-34, 34):
        pieces += laid(motor(30, 0, 92, fins=6), at(-_A2 - 205, y, 90, axis="-x"))
    return pieces


def forearm() -> list[Piece]:
    """Return the arm from the elbow, at x = 20.3, up along z to the wrist; y along the elbow's axis."""
    pieces = laid(
        [drum(PAINT, 62, -42, 40, fillet=5), drum(STEEL, 46, -44, 42, fillet=0)], at(-_A3, 0, 0, axis="+y")
    )
    pieces += laid(cover(52, 0, 14, count=6), at(-_A3, -41, 0, axis="-y"))
    # x of the body is z of the link, its y the link's x.
    upwards = np.array([[0.0, 1, 0, 0], [0, 0, 1, 0], [1, 0, 0, 0], [0, 0, 0, 1]])
    body = tapered(
        PAINT,
        [(-112, 88, 76, 16), (-40, 112, 84, 18), (70, 104, 82, 14), (250, 78, 76, 2), (348, 74, 74, 0)],
        20,
    )
    pieces += laid([body], upwards)
    pieces += [drum(STEEL, 33, 345, 352, fillet=0)]
    pieces.append(rounded_box(CASTING, (70, 60, 10), (16, 0, -113), radius=8, bevel=3))
    for x in (-6, 38):
        pieces += laid(motor(19, 0, 56, fins=4), at(x, 0, -117, axis="-z"))
    outline = strap(np.array([90.0, 12.0]), 28, np.array([240.0, 3.0]), 20, 40)
    panel = laid([(CASTING, plate(outline, 36, 42, 2))], upwards)
    return [*pieces, *panel]


def wrist() -> list[Piece]:
    """Return the roll cylinder and the fork of the bend; -y along the roll axis, z along the bend axis."""
    roll = laid(
        [
            turned_piece(PAINT, [(0, 34), (36, 34), (37, 66), (34, 80), (0, 80)], fillet=4),
            drum(CASTING, 38.5, 56, 62, fillet=0),
        ],
        at(axis="+y"),
    )
    pieces = [*roll]
    for low, high in ((27, 41), (-41, -27)):
        pieces.append(cheek(PAINT, (0, 44), 33, (0, 0), 33, low, high, bevel=3))
    pieces += laid(cover(27, 0, 8, count=5), at(0, 0, 40.5))
    pieces += laid(cover(27, 0, 8, count=5), at(0, 0, -40.5, axis="-z"))
    return pieces


def wrist_cage() -> list[Piece]:
    """Return the bending block: y along the bend axis, z along the flange's axis."""
    hub = laid([drum(CASTING, 30, -25.5, 25.5, fillet=3), drum(STEEL, 22, -27, 27, fillet=0)], at(axis="+y"))
    nose = turned_piece(CASTING, [(0, 0), (24, 0), (24, 22), (27, 25), (0, 25)], fillet=3)
    return [*hub, nose]


def flange() -> list[Piece]:
    """Return the tool flange, with its face at the link's origin."""
    disc = turned_piece(
        STEEL,
        [(0, -16), (20, -16), (20, -11), (31, -10), (31, 0), (11, 0), (11, -6), (0, -6)],
        fillet=1.2,
    )
    holes: list[Piece] = []
    for angle in np.radians([0, 90, 180, 270]):
        place = at(21 * float(np.cos(angle)), 21 * float(np.sin(angle)))
        holes += laid([drum(RUBBER, 3.2, -2.0, 0.3)], place)
    mark = rounded_box(PAINT, (4, 8, 8), (31.5, 0, -5.2), radius=1.2, bevel=0.8)
    return [disc, *holes, mark]
