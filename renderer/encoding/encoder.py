"""Encoders: H.264 for video, JPEG for still pictures.

H.264 is in the form that Foxglove's CompressedVideo and WebCodecs require: Annex B, one packet per picture,
no B-frames, SPS and PPS with each key frame.
"""

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol

import av
import av.logging
import cv2
import numpy as np
from av.error import FFmpegError
from av.video.codeccontext import VideoCodecContext
from av.video.frame import PictureType
from numpy.typing import NDArray

from renderer.errors import NoEncoderError

log = logging.getLogger(__name__)

Picture = NDArray[np.uint8]

# Key frames are requested by time: the encoder would count pictures, which have no fixed rate.
_NEVER = 1_000_000
_ITU601, _LIMITED_RANGE = 6, 1

# Rate buffer of a stream with a limited bit rate, in seconds: keeps key frames small.
_BURST_S = 0.5
_FEW_BITS_QUALITY = "28"

# Why NVENC is missing, for the causes that FFmpeg names in the terms of its libraries.
_CAUSES = {
    "unsupported device": "this GPU has no NVENC",
    "Cannot load libcuda": "there is no NVIDIA driver",
    "Cannot load libnvidia-encode": (
        "the NVIDIA driver's libnvidia-encode is missing; in a container NVIDIA_DRIVER_CAPABILITIES must "
        "contain `video`"
    ),
}
# PyAV's level of logging is the process's.
_log_level = threading.Lock()

# The first that works is used: the GPU's, then x264.
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
    """An encoder of one stream's pictures in order."""

    name: str

    def encode(self, picture: Picture, *, key_frame: bool) -> Packet:
        """Return the packet of an RGB picture (height, width, 3), optionally as a key frame."""


class H264Encoder:
    """An H.264 encoder of FFmpeg."""

    def __init__(
        self, size: tuple[int, int], fps: float, *, codec: str, most_bits_per_s: float = 0.0
    ) -> None:
        """Open the encoder.

        Args:
            fps: Highest rate; a slower stream has a lower bit rate.
            most_bits_per_s: Highest bit rate; 0: no limit, constant quality.

        Raises:
            NoEncoderError: If the encoder does not work on this machine.
        """
        self.name = codec
        self._number = 0
        lines: list[str] = []
        try:
            context = av.CodecContext.create(codec, "w")
            assert isinstance(context, VideoCodecContext)
            context.width, context.height = size
            context.pix_fmt = "yuv420p"
            context.framerate = Fraction(round(fps))
            context.time_base = Fraction(1, round(fps))
            context.gop_size, context.max_b_frames = _NEVER, 0
            # Declared in the stream; otherwise players guess it from the picture's height.
            context.colorspace = context.color_primaries = context.color_trc = _ITU601
            context.color_range = _LIMITED_RANGE
            context.options = _CODECS[codec] | _limit(codec, most_bits_per_s)
            # One thread: one slice per picture, and the other cores stay free for drawing.
            context.thread_count = 1
            with _ffmpeg_errors(lines):
                context.open()
        except (FFmpegError, ValueError) as error:
            reason = _reason(lines) or getattr(error, "strerror", None) or error
            raise NoEncoderError(f"{codec} cannot be opened: {reason}") from None
        self._context = context

    def encode(self, picture: Picture, *, key_frame: bool) -> Packet:
        """Return the packet of an RGB picture (height, width, 3), optionally as a key frame.

        Raises:
            NoEncoderError: If the encoder failed; it must not be used again.
        """
        # Converted by OpenCV: FFmpeg takes 1 to 2.5 ms longer.
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
            raise NoEncoderError(f"{self.name} returned {len(packets)} packets for a picture instead of one")
        return Packet(bytes(packets[0]), bool(packets[0].is_keyframe))


@contextmanager
def _ffmpeg_errors(lines: list[str]) -> Iterator[None]:
    """Add the errors that FFmpeg logs in this thread to `lines`; its exceptions hold only an errno."""
    with _log_level, av.logging.Capture() as logs:
        # Otherwise a second attempt with the same error has no reason.
        av.logging.set_skip_repeated(False)
        av.logging.set_level(av.logging.ERROR)
        try:
            yield
        finally:
            av.logging.set_level(None)
            lines += [" ".join(text.split()) for _, _, text in logs]


def _reason(lines: list[str]) -> str:
    text = "; ".join(dict.fromkeys(filter(None, lines)))
    cause = next((cause for sign, cause in _CAUSES.items() if sign in text), "")
    return f"{cause} ({text})" if cause else text


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
    """Return the name of this machine's best H.264 encoder, after a trial with a picture.

    Raises:
        NoEncoderError: If none works; the text has each encoder's reason.
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
            log.info("%s; %s is used instead, on the processor", reason, codec)
        return codec
    raise NoEncoderError("no H.264 encoder works: " + "; ".join(reasons))


def open_encoder(
    size: tuple[int, int], fps: float, *, codec: str | None = None, most_bits_per_s: float = 0.0
) -> VideoEncoder:
    """Return an encoder for a stream.

    Args:
        codec: The preferred encoder; None: the best one.

    Raises:
        NoEncoderError: If none works; the text has each encoder's reason.
    """
    try:
        found = codec or best_codec(size, fps)
        return H264Encoder(size, fps, codec=found, most_bits_per_s=most_bits_per_s)
    except NoEncoderError:
        if codec is None:
            raise
    # The GPU may have reached its number of streams, or not support the picture's size.
    return open_encoder(size, fps, most_bits_per_s=most_bits_per_s)


def jpeg(picture: Picture, *, quality: int = 88) -> bytes:
    """Encode an RGB picture (height, width, 3) as JPEG."""
    _, data = cv2.imencode(
        ".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    return bytes(data)
