"""Post-processing of drawn pictures: overlay and encoding, in other threads than drawing."""

from dataclasses import dataclass

from renderer.encoding.encoder import Packet, VideoEncoder, jpeg, open_encoder
from renderer.errors import NoEncoderError
from renderer.pictures.clearance_line import ClearanceLine, draw_clearance_line
from renderer.pictures.overlay import Overlay, Picture, write_over
from renderer.pictures.requested_views import ViewSpec
from renderer.scene.cameras import Camera


@dataclass(frozen=True, kw_only=True)
class PictureJob:
    """Instructions for a picture.

    Attributes:
        stream: The video stream that it belongs to.
        clearance_line: Drawn under the texts.
        labelled: Write the clearance line's length.
        video: Encode it for the stream.
        key_frame: Encode it as a key frame.
        image: Encode it as JPEG.
    """

    stream: str
    spec: ViewSpec
    overlay: Overlay
    clearance_line: ClearanceLine | None = None
    labelled: bool = True
    video: bool = False
    key_frame: bool = False
    image: bool = False


@dataclass(frozen=True)
class EncodedPicture:
    """The encoded picture: a video packet, a JPEG, or both."""

    packet: Packet | None
    jpeg: bytes | None


class PostProcessor:
    """The encoders of the streams of one encoding thread; every method runs in that thread."""

    def __init__(self, codec: str) -> None:
        """Open no encoder yet.

        Args:
            codec: FFmpeg's name of the preferred encoder.
        """
        self._codec = codec
        self._encoders: dict[str, VideoEncoder] = {}

    def process(self, picture: Picture, camera: Camera, wanted: PictureJob) -> EncodedPicture:
        """Write the overlay on a picture (height, width, 3), in place, and encode it.

        Raises:
            NoEncoderError: If the stream's encoder failed; the next picture gets a new one.
        """
        if wanted.clearance_line is not None:
            draw_clearance_line(picture, camera, wanted.clearance_line, labelled=wanted.labelled)
        write_over(picture, wanted.overlay)
        packet = None
        if wanted.video:
            encoder = self._encoder(wanted.stream, wanted.spec)
            try:
                packet = encoder.encode(picture, key_frame=wanted.key_frame)
            except NoEncoderError:
                del self._encoders[wanted.stream]
                raise
        return EncodedPicture(packet, jpeg(picture) if wanted.image else None)

    def end(self, stream: str) -> None:
        """Release a stream's encoder."""
        self._encoders.pop(stream, None)

    def _encoder(self, stream: str, spec: ViewSpec) -> VideoEncoder:
        encoder = self._encoders.get(stream)
        if encoder is None:
            encoder = open_encoder(
                spec.size, spec.fps, codec=self._codec, most_bits_per_s=spec.most_bits_per_s
            )
            self._encoders[stream] = encoder
        return encoder
