"""Pictures to bytes: H.264 for who watches, JPEG for who wants one.

H.264 as Foxglove's CompressedVideo and WebCodecs take it: Annex B, one packet a picture, no
B-frames, SPS and PPS with each key frame.
"""

import logging
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import av
import cv2
import numpy as np
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType
from numpy.typing import NDArray

from renderer.errors import NoEncoderError

log = logging.getLogger(__name__)

Picture = NDArray[np.uint8]

# The clock of key frames is ours: the encoder's own would count pictures, which come unevenly.
_NEVER = 1_000_000
_ITU601, _LIMITED_RANGE = 6, 1

# Of a stream that may have few bits: this much of a second may come at once, so key frames stay small.
_BURST_S = 0.5
_FEW_BITS_QUALITY = "28"

# The first that opens is used: a GPU's if there is one, then x264.
_CODECS: dict[str, dict[str, str]] = {
    "h264_nvenc": {
        "preset": "p3",
        "tune": "ull",
        "rc": "vbr",
        "cq": "26",
        "delay": "0",
        "zerolatency": "1",
        "forced-idr": "1",
    },
    "libx264": {
        "preset": "superfast",
        "tune": "zerolatency",
        "crf": "23",
        "forced-idr": "1",
        "x264-params": "repeat-headers=1:scenecut=0:bframes=0",
    },
}


@dataclass(frozen=True)
class Packet:
    """One picture of a video stream."""

    data: bytes
    key_frame: bool


class VideoEncoder(Protocol):
    """Encodes one stream's pictures, in their order."""

    name: str

    def encode(self, picture: Picture, *, key_frame: bool) -> Packet:
        """The packet of an RGB picture (height, width, 3); as a key frame if asked."""


class H264Encoder:
    """H.264 by one of FFmpeg's encoders."""

    def __init__(
        self, size: tuple[int, int], fps: float, *, codec: str, most_bits_per_s: float = 0.0
    ) -> None:
        """Open the encoder.

        Args:
            fps: Highest rate; the bits of a slower stream are fewer.
            most_bits_per_s: Highest; 0: as many as the quality needs.

        Raises:
            NoEncoderError: If this machine cannot.
        """
        self.name = codec
        self._number = 0
        try:
            context = av.CodecContext.create(codec, "w")
            assert isinstance(context, VideoCodecContext)
            context.width, context.height = size
            context.pix_fmt = "yuv420p"
            context.framerate = Fraction(round(fps))
            context.time_base = Fraction(1, round(fps))
            context.gop_size, context.max_b_frames = _NEVER, 0
            # Said in the stream, or a player guesses by the picture's height.
            context.colorspace = context.color_primaries = context.color_trc = _ITU601
            context.color_range = _LIMITED_RANGE
            context.options = _CODECS[codec] | _limit(codec, most_bits_per_s)
            # One slice a picture, and no core taken from the drawing.
            context.thread_count = 1
            context.open()
        except (FFmpegError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise NoEncoderError(f"{codec} cannot be opened: {reason}") from None
        self._context = context

    def encode(self, picture: Picture, *, key_frame: bool) -> Packet:
        """The packet of an RGB picture (height, width, 3); as a key frame if asked.

        Raises:
            NoEncoderError: If the encoder failed; it is of no more use.
        """
        # OpenCV's conversion: FFmpeg's takes 1 to 2.5 ms more.
        planes = np.asarray(cv2.cvtColor(picture, cv2.COLOR_RGB2YUV_I420), dtype=np.uint8)
        frame = av.VideoFrame.from_ndarray(planes, format="yuv420p")
        frame.pts = self._number
        self._number += 1
        frame.pict_type = PictureType.I if key_frame else PictureType.NONE
        try:
            packets = self._context.encode(frame)
        except FFmpegError as error:
            raise NoEncoderError(f"{self.name} failed: {error}") from None
        if len(packets) != 1:
            raise NoEncoderError(f"{self.name} gave {len(packets)} packets for a picture: one is right")
        return Packet(bytes(packets[0]), bool(packets[0].is_keyframe))


def _limit(codec: str, most_bits_per_s: float) -> dict[str, str]:
    if not most_bits_per_s:
        return {}
    quality = "cq" if codec == "h264_nvenc" else "crf"
    return {
        quality: _FEW_BITS_QUALITY,
        "maxrate": str(round(most_bits_per_s)),
        "bufsize": str(round(most_bits_per_s * _BURST_S)),
    }


def best_codec(size: tuple[int, int], fps: float) -> str:
    """The best H.264 encoder of this machine, tried on a picture.

    Raises:
        NoEncoderError: If none works; the text tells why of each.
    """
    reasons = []
    for codec in _CODECS:
        try:
            trial = H264Encoder(size, fps, codec=codec)
            trial.encode(np.zeros((size[1], size[0], 3), dtype=np.uint8), key_frame=True)
        except NoEncoderError as error:
            reasons.append(str(error))
            continue
        for reason in reasons:
            log.info("%s: %s is used instead", reason, codec)
        return codec
    raise NoEncoderError("no H.264 encoder here: " + "; ".join(reasons))


def open_encoder(
    size: tuple[int, int], fps: float, *, codec: str | None = None, most_bits_per_s: float = 0.0
) -> VideoEncoder:
    """An encoder for a stream.

    Args:
        codec: The one that was found best; None: it is looked for.

    Raises:
        NoEncoderError: If none works; the text tells why of each.
    """
    try:
        found = codec or best_codec(size, fps)
        return H264Encoder(size, fps, codec=found, most_bits_per_s=most_bits_per_s)
    except NoEncoderError:
        if codec is None:
            raise
    # A GPU has no room for another stream, or takes no picture as small.
    return open_encoder(size, fps, most_bits_per_s=most_bits_per_s)


def jpeg(picture: Picture, *, quality: int = 88) -> bytes:
    """An RGB picture (height, width, 3) as JPEG."""
    _, data = cv2.imencode(
        ".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    return bytes(data)
