"""What becomes of a drawn picture: written over and encoded, in a thread beside the drawing one."""

from collections.abc import Iterable
from dataclasses import dataclass

from renderer.cameras import Camera
from renderer.clearance_line import Span, draw_span
from renderer.encoder import Packet, VideoEncoder, best_codec, jpeg, open_encoder
from renderer.errors import NoEncoderError
from renderer.overlay import Overlay, Picture, write_over
from renderer.requested_views import Shot


@dataclass(frozen=True, kw_only=True)
class Order:
    """What is to become of a picture.

    Attributes:
        stream: The video stream that it belongs to.
        span: Drawn under what is written.
        labelled: Whether the span's length is told.
        video: Encode it for the stream.
        key_frame: As a key frame.
        image: Encode it as JPEG.
    """

    stream: str
    shot: Shot
    overlay: Overlay
    span: Span | None = None
    labelled: bool = True
    video: bool = False
    key_frame: bool = False
    image: bool = False


@dataclass(frozen=True)
class Finished:
    """What came of it."""

    packet: Packet | None
    jpeg: bytes | None


class Finishing:
    """The streams' encoders; every method runs in one thread of its own.

    Attributes:
        codec: What encodes, in FFmpeg's words.
    """

    def __init__(self, size: tuple[int, int], fps: float) -> None:
        """Look for an encoder: a machine without one must say so at its start.

        Raises:
            NoEncoderError: If no H.264 encoder works.
        """
        self.codec = best_codec(size, fps)
        self._encoders: dict[str, VideoEncoder] = {}

    def finish(self, picture: Picture, camera: Camera, wanted: Order) -> Finished:
        """Write over a picture (height, width, 3), in place, and encode it.

        Raises:
            NoEncoderError: If the stream's encoder failed; the next picture gets a new one.
        """
        if wanted.span is not None:
            draw_span(picture, camera, wanted.span, labelled=wanted.labelled)
        write_over(picture, wanted.overlay)
        packet = None
        if wanted.video:
            encoder = self._encoder(wanted.stream, wanted.shot)
            try:
                packet = encoder.encode(picture, key_frame=wanted.key_frame)
            except NoEncoderError:
                del self._encoders[wanted.stream]
                raise
        return Finished(packet, jpeg(picture) if wanted.image else None)

    def end(self, streams: Iterable[str]) -> None:
        """Release the encoders of streams that nobody watches."""
        for stream in streams:
            self._encoders.pop(stream, None)

    def _encoder(self, stream: str, shot: Shot) -> VideoEncoder:
        encoder = self._encoders.get(stream)
        if encoder is None:
            encoder = open_encoder(
                shot.size, shot.fps, codec=self.codec, most_bits_per_s=shot.most_bits_per_s
            )
            self._encoders[stream] = encoder
        return encoder
