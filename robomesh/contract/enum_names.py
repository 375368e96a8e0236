"""Names of enum values in messages. A newer program may send a value that this one does not know."""

from typing import Any


def enum_name(enum: Any, number: int) -> str:
    """Return the name of an enum's value; of an unknown value, its number.

    Args:
        enum: The enum, as in `ControllerState.Link`.
        number: The received value.
    """
    value = enum.DESCRIPTOR.values_by_number.get(number)
    return str(number) if value is None else str(value.name)


def enum_word(enum: Any, number: int) -> str:
    """Return the name in lower case, without the enum's own name: "unknown" for `MODE_UNKNOWN`."""
    return enum_name(enum, number).lower().removeprefix(f"{enum.DESCRIPTOR.name.lower()}_")
