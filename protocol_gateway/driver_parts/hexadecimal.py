"""Bytes of a binary protocol, as events show them."""

_SHOWN_BYTES = 32


def hexadecimal(data: bytes | bytearray) -> str:
    """Return the first 32 bytes from a peer in hexadecimal."""
    return data[:_SHOWN_BYTES].hex(" ") + (" …" if len(data) > _SHOWN_BYTES else "")
