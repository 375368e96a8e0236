"""Samples as pages get them: WebSocket frames, encoded once for all browsers; only the age differs."""

import functools
import struct
import time
from collections.abc import Iterable, Iterator

from websockets.frames import Frame, Opcode

from robomesh.header import pack
from robomesh.schemas.robomesh_pb2 import ToPage
from robomesh.subscription import Sample

# Field 1 of ToPage, a message; field 5 of its Sample, a double: fields of a message may come in any order.
_SAMPLE, _AGE = 0x0A, 0x29
_AGED = struct.Struct("<Bd")
# Small: what is passed on to the last browser before so much else came.
_MOST_STATES, _MOST_PICTURES = 256, 16
# So much is given to a line at once; to one that is behind less, for newer must still be able to replace
# what waits.
MOST_TOGETHER, MOST_BEHIND = 16 * 1024, 4096
# An age that is told may be less than the true one by so much: the last pages are served after the first.
_SAME_AGE_S = 0.005


class Moment:
    """Samples of state that came together: for every page that watches them the same bytes.

    Attributes:
        samples: In the order in which they came.
        overtaken: How many more came, of which these are newer.
    """

    def __init__(self, samples: list[Sample], overtaken: int = 0) -> None:
        self.samples, self.overtaken = samples, overtaken
        self._aged = bytearray()
        # Where an age belongs, and since when it is counted.
        self._ages: list[tuple[int, float]] = []
        self._frames, self._at = b"", 0.0

    def frames(self) -> bytes:
        """A WebSocket frame of each."""
        now = time.monotonic()
        if now - self._at > _SAME_AGE_S:
            if not self._aged:
                self._encode()
            for at, since in self._ages:
                _AGED.pack_into(self._aged, at, _AGE, now - since)
            self._frames, self._at = bytes(self._aged), now
        return self._frames

    def _encode(self) -> None:
        for sample in self.samples:
            self._aged += state_frame(sample)
            if sample.live:
                self._ages.append((len(self._aged) - _AGED.size, sample.received - sample.late_s))


def moments(samples: Iterable[Sample], overtaken: int = 0) -> Iterator[Moment]:
    """Samples in pieces that may be given to a line at once; the first is told how many were overtaken."""
    together: list[Sample] = []
    size = 0
    for sample in samples:
        if together and size + len(sample.payload) > MOST_BEHIND:
            yield Moment(together, overtaken)
            together, size, overtaken = [], 0, 0
        together.append(sample)
        size += len(sample.payload)
    if together:
        yield Moment(together, overtaken)


def frame(message: bytes) -> bytes:
    """A message of the page's protocol as a WebSocket frame."""
    return Frame(Opcode.BINARY, message).serialize(mask=False)


def state_frame(sample: Sample) -> bytes:
    """A sample of state, its payload and attachment as they were, with its age where it is known."""
    return _aged(_state_without_age(sample), sample)


def video_frame(sample: Sample, *, key: str, step: int) -> bytes:
    """A picture.

    Args:
        key: As the page watches it.
        step: How far the view is reduced.
    """
    return _aged(_picture_without_age(sample, key, step), sample)


def _aged(framed: bytes, sample: Sample) -> bytes:
    if not sample.live:
        return framed
    return framed + _AGED.pack(_AGE, time.monotonic() - sample.received + sample.late_s)


@functools.lru_cache(_MOST_STATES)
def _state_without_age(sample: Sample) -> bytes:
    return _without_age(sample, sample.key, 0)


@functools.lru_cache(_MOST_PICTURES)
def _picture_without_age(sample: Sample, key: str, step: int) -> bytes:
    return _without_age(sample, key, step)


def _without_age(sample: Sample, key: str, step: int) -> bytes:
    """A frame, but for the age, whose bytes are counted where they are to follow: it stands at the end."""
    body = ToPage.Sample(
        key=key, attachment=pack(sample.header), payload=sample.payload, live=sample.live, step=step
    ).SerializeToString()
    age = bytes(_AGED.size) if sample.live else b""
    whole = frame(bytes([_SAMPLE]) + _varint(len(body) + len(age)) + body + age)
    return whole[: len(whole) - len(age)]


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
