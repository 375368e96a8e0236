"""Texts of controllers, in the encoding of their pendants."""


def text(data: bytes) -> str:
    """Return a text up to its first zero byte, on one line; its encoding is the pendant's."""
    data = data.partition(b"\0")[0]
    for encoding in ("utf-8", "shift_jis"):
        try:
            found = data.decode(encoding)
        except UnicodeDecodeError:
            continue
        return "".join(each if each.isprintable() else " " for each in found).strip()
    return "".join(chr(byte) if 32 <= byte < 127 else "?" for byte in data).strip()
