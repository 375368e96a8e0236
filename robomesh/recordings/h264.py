"""H.264 byte streams in the Annex B format (ITU-T H.264, Annex B)."""

_START_CODE = b"\x00\x00\x01"
# Types of NAL units (table 7-1).
_SLICE, _IDR_SLICE, _SEQUENCE_PARAMETERS = 1, 5, 7


def is_key_frame(data: bytes) -> bool:
    """Return whether a decoder can begin with this picture: it has parameter sets or an IDR slice."""
    at = data.find(_START_CODE)
    while 0 <= at < len(data) - 3:
        unit_type = data[at + 3] & 0x1F
        if unit_type in (_IDR_SLICE, _SEQUENCE_PARAMETERS):
            return True
        if unit_type == _SLICE:  # the parameter sets come before the first slice
            return False
        at = data.find(_START_CODE, at + 3)
    return False
