"""Key frames of H.264 byte streams."""

from robomesh.recordings.h264 import is_key_frame

KEY = b"\0\0\0\1\x67\x42\xc0\x1f\0\0\0\1\x68\xce\0\0\0\1\x65\x88"
DELTA = b"\0\0\0\1\x41\x9a\x01"


def test_a_key_frame_has_parameter_sets_or_an_idr_slice():
    assert is_key_frame(KEY)
    assert is_key_frame(b"\0\0\1\x65\x88")
    assert not is_key_frame(DELTA)
    assert not is_key_frame(b"\0\0\1\x06\x05" + DELTA)


def test_bytes_without_a_picture_are_no_key_frame():
    assert not is_key_frame(b"")
    assert not is_key_frame(b"\0\0\1")
