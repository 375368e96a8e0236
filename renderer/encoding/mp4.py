"""Fragmented MP4 from H.264 packets without re-encoding: one fragment per picture, playable while written.

FFmpeg's muxer (PyAV 18.1) is not used: it writes a picture only when the next one arrives or, with
`frag_keyframe`, the next key frame, and it decodes the first picture to learn its size. Here each picture is
written with its own packet.

Source: ISO/IEC 14496-12 (boxes) and 14496-15 (H.264 in them).
"""

import struct
from dataclasses import dataclass

from renderer.errors import Mp4Error
from robomesh.recordings.h264 import (
    DELIMITER,
    IDR_SLICE,
    PICTURE_PARAMETERS,
    SEQUENCE_PARAMETERS,
    nal_units,
    picture_size,
)

# Ticks per second of all times in the file, the usual value for video.
TIMESCALE = 90_000
_MATRIX = struct.pack(">9I", 0x10000, 0, 0, 0, 0x10000, 0, 0, 0, 0x40000000)
# sample_depends_on, sample_is_non_sync_sample: a key frame depends on nothing.
_KEY_FLAGS, _OTHER_FLAGS = 0x02000000, 0x01010000


@dataclass(frozen=True)
class _Unpacked:
    """A packet's picture in MP4's format, and the parameter sets of a key frame."""

    picture: bytes
    sps: bytes
    pps: bytes
    key_frame: bool


class FragmentedMp4:
    """One video track; nothing is buffered, so a truncated file plays up to its end.

    Attributes:
        pictures: Number of pictures written.
    """

    def __init__(self) -> None:
        self.pictures = 0
        self._parameters: tuple[bytes, bytes] | None = None
        self._start_ns = 0
        self._at = self._end = 0

    @property
    def duration_s(self) -> float:
        """Time from the first picture to the end of the last [s]."""
        return self._end / TIMESCALE

    def add(self, packet: bytes, time_ns: int, *, usual_s: float = 1 / 30) -> bytes:
        """Return the bytes that a packet adds to the file; empty until the first key frame.

        Args:
            packet: One picture in Annex B, with SPS and PPS if it is a key frame.
            time_ns: When it is shown, on any clock; the file begins at the first picture.
            usual_s: Duration of a picture, as the next one's time is unknown [s].

        Raises:
            Mp4Error: If it is not a valid packet, or the stream's parameters have changed.
        """
        unpacked = _unpack(packet)
        head = b""
        if self._parameters is None:
            if not unpacked.key_frame:
                return b""
            if not (unpacked.sps and unpacked.pps):
                raise Mp4Error("a key frame has no parameter sets (SPS and PPS)")
            self._parameters, self._start_ns = (unpacked.sps, unpacked.pps), time_ns
            head = _head(unpacked.sps, unpacked.pps)
        elif unpacked.key_frame and unpacked.sps and (unpacked.sps, unpacked.pps) != self._parameters:
            raise Mp4Error("the video's size or encoder has changed: begin a new file")
        # Times increase even if the clock stops or goes back.
        at = max((time_ns - self._start_ns) * TIMESCALE // 10**9, self._at + 1 if self.pictures else 0)
        duration = max(round(usual_s * TIMESCALE), 1)
        self.pictures += 1
        self._at, self._end = at, at + duration
        return head + _fragment(self.pictures, at, duration, unpacked)


def _unpack(packet: bytes) -> _Unpacked:
    picture, sps, pps, key_frame = b"", b"", b"", False
    for kind, unit in nal_units(packet):
        if kind == SEQUENCE_PARAMETERS:
            sps = unit
        elif kind == PICTURE_PARAMETERS:
            pps = unit
        elif kind != DELIMITER:  # MP4's samples already delimit pictures
            key_frame |= kind == IDR_SLICE
            picture += struct.pack(">I", len(unit)) + unit
    if not picture:
        raise Mp4Error(f"a packet of {len(packet)} bytes contains no H.264 picture (Annex B)")
    return _Unpacked(picture, sps, pps, key_frame)


def _box(kind: bytes, *content: bytes) -> bytes:
    body = b"".join(content)
    return struct.pack(">I4s", len(body) + 8, kind) + body


def _full(kind: bytes, *content: bytes, version: int = 0, flags: int = 0) -> bytes:
    return _box(kind, struct.pack(">I", version << 24 | flags), *content)


def _head(sps: bytes, pps: bytes) -> bytes:
    """Return the boxes of file type and movie: one track with all samples in fragments."""
    try:
        width, height = picture_size(sps)
    except ValueError as error:
        raise Mp4Error(str(error)) from None
    movie = _full(
        b"mvhd",
        struct.pack(">IIIIIH10x", 0, 0, TIMESCALE, 0, 0x10000, 0x100),
        _MATRIX,
        bytes(24),
        struct.pack(">I", 2),
    )
    # Enabled, and in the movie.
    track = _full(
        b"tkhd",
        struct.pack(">IIIII8xHHHH", 0, 0, 1, 0, 0, 0, 0, 0, 0),
        _MATRIX,
        struct.pack(">II", width << 16, height << 16),
        flags=3,
    )
    undetermined = 0x55C4  # the language "und"
    media = _box(
        b"mdia",
        _full(b"mdhd", struct.pack(">IIIIHH", 0, 0, TIMESCALE, 0, undetermined, 0)),
        _full(b"hdlr", struct.pack(">I4s12x", 0, b"vide"), b"video\0"),
        _box(
            b"minf",
            _full(b"vmhd", bytes(8), flags=1),
            _box(b"dinf", _full(b"dref", struct.pack(">I", 1), _full(b"url ", flags=1))),
            _box(
                b"stbl",
                _full(b"stsd", struct.pack(">I", 1), _sample_entry(sps, pps, width, height)),
                _full(b"stts", bytes(4)),
                _full(b"stsc", bytes(4)),
                _full(b"stsz", bytes(8)),
                _full(b"stco", bytes(4)),
            ),
        ),
    )
    extends = _box(b"mvex", _full(b"trex", struct.pack(">IIIII", 1, 1, 0, 0, 0)))
    brands = struct.pack(">4sI", b"iso5", 512) + b"iso5iso6avc1mp41"
    return _box(b"ftyp", brands) + _box(b"moov", movie, _box(b"trak", track, media), extends)


def _sample_entry(sps: bytes, pps: bytes, width: int, height: int) -> bytes:
    configuration = (
        bytes([1, sps[1], sps[2], sps[3], 0xFF, 0xE1])
        + struct.pack(">H", len(sps))
        + sps
        + struct.pack(">BH", 1, len(pps))
        + pps
    )
    if sps[1] in (100, 110, 122, 144):
        # 4:2:0, 8 bits, no more parameter sets.
        configuration += bytes([0xFC | 1, 0xF8, 0xF8, 0])
    return _box(
        b"avc1",
        struct.pack(">6xH16xHHII4xH", 1, width, height, 72 << 16, 72 << 16, 1),
        bytes(32),
        struct.pack(">Hh", 24, -1),
        _box(b"avcC", configuration),
    )


def _fragment(number: int, at: int, duration: int, unpacked: _Unpacked) -> bytes:
    flags = _KEY_FLAGS if unpacked.key_frame else _OTHER_FLAGS

    def moof(offset: int) -> bytes:
        return _box(
            b"moof",
            _full(b"mfhd", struct.pack(">I", number)),
            _box(
                b"traf",
                # Offsets count from the fragment's beginning.
                _full(b"tfhd", struct.pack(">I", 1), flags=0x020000),
                _full(b"tfdt", struct.pack(">Q", at), version=1),
                # One sample with offset, duration, size and flags.
                _full(
                    b"trun",
                    struct.pack(">IiIII", 1, offset, duration, len(unpacked.picture), flags),
                    flags=0x000701,
                ),
            ),
        )

    return moof(len(moof(0)) + 8) + _box(b"mdat", unpacked.picture)
