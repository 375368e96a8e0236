"""Numbers and placements in URDF's attributes."""

import xml.etree.ElementTree as Xml
from math import isfinite

import numpy as np

from robots.poses import FloatArray, rpy_rotation

# No arm is as long: the file is in millimetres.
_FARTHEST_M = 100.0


class WrongElement(Exception):
    """What is wrong with an element, in words."""


def numbers(element: Xml.Element | None, key: str, count: int, what: str, default: str) -> list[float]:
    """The numbers of an attribute; those of `default` where it is not there.

    Raises:
        WrongElement: If there are not `count` finite ones.
    """
    text = default if element is None else element.get(key, default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(isfinite, values)):
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise WrongElement(f"{what} {key} = {said(element, key)}: must be {wanted}")
    return values


def said(element: Xml.Element | None, key: str) -> str:
    """An attribute as the file has it, cut where it is long."""
    text = "" if element is None else element.get(key, "")
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


def origin(element: Xml.Element, what: str) -> FloatArray:
    """(4, 4) of an element's <origin>."""
    placement = np.eye(4)
    found = element.find("origin")
    if found is not None:
        placement[:3, :3] = rpy_rotation(*numbers(found, "rpy", 3, f"{what} origin", "0 0 0"))
        xyz = numbers(found, "xyz", 3, f"{what} origin", "0 0 0")
        if max(map(abs, xyz)) > _FARTHEST_M:
            farthest = f"more than {_FARTHEST_M:g} m; a URDF counts in metres"
            raise WrongElement(f"{what} origin xyz = {said(found, 'xyz')}: {farthest}")
        placement[:3, 3] = xyz
    return placement
