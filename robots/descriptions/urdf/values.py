"""Parsing of numbers and placements in URDF attributes."""

import xml.etree.ElementTree as Xml
from math import isfinite

import numpy as np

from robots.schema.poses import FloatArray, rpy_rotation

# No arm is this long: the file is in millimetres.
_FARTHEST_M = 100.0


class WrongElement(Exception):
    """An invalid element; the text says what is wrong and what it must be."""


def numbers(element: Xml.Element | None, key: str, count: int, what: str, default: str) -> list[float]:
    """Return the numbers in an attribute, or in `default` if the attribute is missing.

    Raises:
        WrongElement: If there are not exactly `count` finite numbers.
    """
    text = default if element is None else element.get(key, default)
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(isfinite, values)):
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise WrongElement(f"{what} {key} = {quoted(element, key)}: must be {wanted}")
    return values


def quoted(element: Xml.Element | None, key: str) -> str:
    """Return an attribute in quotes, truncated to 60 characters."""
    text = "" if element is None else element.get(key, "")
    return repr(text if len(text) <= 60 else f"{text[:57]}...")


def origin(element: Xml.Element, what: str) -> FloatArray:
    """Return the (4, 4) placement in an element's <origin>."""
    placement = np.eye(4)
    found = element.find("origin")
    if found is not None:
        placement[:3, :3] = rpy_rotation(*numbers(found, "rpy", 3, f"{what} origin", "0 0 0"))
        xyz = numbers(found, "xyz", 3, f"{what} origin", "0 0 0")
        if max(map(abs, xyz)) > _FARTHEST_M:
            farthest = f"more than {_FARTHEST_M:g} m; a URDF counts in metres"
            raise WrongElement(f"{what} origin xyz = {quoted(found, 'xyz')}: {farthest}")
        placement[:3, 3] = xyz
    return placement
