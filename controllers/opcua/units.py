"""Engineering units of OPC UA (Part 8, EUInformation), and what they are in SI.

A unit of UNECE Recommendation 20 has its common code as a number: the characters of "C81" are the bytes.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

UNECE = "http://www.opcfoundation.org/UA/units/un/cefact"


def number_of(code: str) -> int:
    """Return the number of a common code: "C81" is 4405297."""
    return int.from_bytes(code.encode(), "big")


@dataclass(frozen=True, slots=True)
class Unit:
    """Unit that a server states.

    Attributes:
        number: UnitId; 0: none.
        text: DisplayName.
    """

    number: int = 0
    text: str = ""

    def __bool__(self) -> bool:
        return bool(self.number or self.text)


NO_UNIT = Unit()


@dataclass(frozen=True, slots=True)
class Scale:
    """Conversion to the unit that robomesh shows: factor * value + offset.

    Attributes:
        unit: The unit after it.
        linear: Of a length; None: neither of a length nor of an angle.
    """

    factor: float
    unit: str
    linear: bool | None = None
    offset: float = 0.0


_DEGREE = Scale(math.radians(1.0), "rad", linear=False)
_RADIAN = Scale(1.0, "rad", linear=False)
_MILLIMETRE, _METRE = Scale(1e-3, "m", linear=True), Scale(1.0, "m", linear=True)
_BY_CODE = {
    "DD": _DEGREE,
    "C81": _RADIAN,
    "MMT": _MILLIMETRE,
    "CMT": Scale(1e-2, "m", linear=True),
    "MTR": _METRE,
    "E96": Scale(math.radians(1.0), "rad/s", linear=False),
    "2A": Scale(1.0, "rad/s", linear=False),
    "C16": Scale(1e-3, "m/s", linear=True),
    "2M": Scale(1e-2, "m/s", linear=True),
    "MTS": Scale(1.0, "m/s", linear=True),
    "P1": Scale(1.0, "%"),
    "KGM": Scale(1.0, "kg"),
    "GRM": Scale(1e-3, "kg"),
    "CEL": Scale(1.0, "°C"),
    "KEL": Scale(1.0, "°C", offset=-273.15),
    "FAH": Scale(5.0 / 9.0, "°C", offset=-160.0 / 9.0),
    "AMP": Scale(1.0, "A"),
    "4K": Scale(1e-3, "A"),
    "VLT": Scale(1.0, "V"),
    "NU": Scale(1.0, "N·m"),
    "NEW": Scale(1.0, "N"),
    "SEC": Scale(1.0, "s"),
    "C26": Scale(1e-3, "s"),
    "HUR": Scale(3600.0, "s"),
}
BY_NUMBER: Mapping[int, Scale] = MappingProxyType({number_of(code): each for code, each in _BY_CODE.items()})
"""By UnitId."""
_BY_TEXT = {
    "°": _DEGREE,
    "deg": _DEGREE,
    "degree": _DEGREE,
    "degrees": _DEGREE,
    "rad": _RADIAN,
    "radian": _RADIAN,
    "mm": _MILLIMETRE,
    "m": _METRE,
    "°/s": _BY_CODE["E96"],
    "deg/s": _BY_CODE["E96"],
    "rad/s": _BY_CODE["2A"],
    "mm/s": _BY_CODE["C16"],
    "m/s": _BY_CODE["MTS"],
    "%": _BY_CODE["P1"],
    "kg": _BY_CODE["KGM"],
    "°C": _BY_CODE["CEL"],
    "K": _BY_CODE["KEL"],
}


def scale_of(unit: Unit) -> Scale | None:
    """Return the conversion of a unit, by its number, else by its name; None: unknown."""
    return BY_NUMBER.get(unit.number) or _BY_TEXT.get(unit.text.strip())
