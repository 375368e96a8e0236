"""How `robomesh probe` knows the unit protocol: these controllers send their state unasked."""

from controllers.probing import Found, Probe
from protocol_gateway.unit_protocol.records import AbsolutePositions, Unknown
from protocol_gateway.unit_protocol.stream import Unit, UnitStream


def _units(heard: bytes) -> tuple[int, int, bool]:
    """Return the number of well-formed units, their number of joints, and whether types are numbers."""
    # A connection begins anywhere in a unit, so the first one may be a rest.
    units = [each for each in UnitStream().receive(heard) if isinstance(each, Unit)]
    records = [record for unit in units for record in unit.records]
    joints = max((len(each.values) for each in records if isinstance(each, AbsolutePositions)), default=0)
    numbers = any(isinstance(each, Unknown) and each.type.lstrip("-").isdigit() for each in records)
    return len(units), joints, numbers


def _heard(heard: bytes) -> Found | None:
    units, joints, numbers = _units(heard)
    if not units:
        return None
    known = f"{joints} joints" if joints else "no joint positions yet"
    codes = ", and `codes`, because it sends numbers (docs/controllers.md)" if numbers else ""
    return Found(
        protocol="unit",
        text=f"it sends units of robomesh's own protocol, with {known}",
        next=f"in the site file: this controller, and a model of {joints or 'its'} joints{codes}",
    )


UNIT = Probe(listens=None, knows=lambda heard: _units(heard)[0] > 1, heard=_heard)
