"""Conversion of the renderer's JPEG pictures to PNG."""

import contextlib
import io
from fractions import Fraction
from importlib import import_module

from robomesh import reason_codes as codes
from services.console.common.errors import RefusedRequest


def prepare() -> None:
    """Import PyAV in advance, so that the first picture is not delayed."""
    with contextlib.suppress(ImportError):
        import_module("av")


def png(jpeg: bytes) -> bytes:
    """Convert a JPEG to PNG.

    Raises:
        RefusedRequest: If PyAV is missing, or the picture cannot be read.
    """
    try:
        import av
    except ImportError:
        raise RefusedRequest(503, codes.VIEW_NO_PNG()) from None
    try:
        with av.open(io.BytesIO(jpeg), "r", format="mjpeg") as container:
            frame = next(container.decode(video=0))
        encoder = av.CodecContext.create("png", "w")
        assert isinstance(encoder, av.VideoCodecContext)
        picture = frame.reformat(format="rgb24")
        encoder.width, encoder.height, encoder.pix_fmt = picture.width, picture.height, "rgb24"
        encoder.framerate = Fraction(1)
        return b"".join(bytes(packet) for packet in (*encoder.encode(picture), *encoder.encode(None)))
    except (av.FFmpegError, StopIteration) as error:
        raise RefusedRequest(502, codes.VIEW_PICTURE_UNREADABLE(detail=error)) from None
