"""WebSocket frames of samples, encoded once for all browsers; only the age is updated."""

import functools
import struct
import time
from collections.abc import Iterable, Iterator

from websockets.frames import Frame, Opcode

from robomesh.contract.header import pack
from robomesh.publications.subscription import Sample
from robomesh.schemas.robomesh_pb2 import ToPage

# Field 1 of ToPage, a message; field 5 of its Sample, a double. Fields of a message may have any order.
_SAMPLE, _AGE = 0x0A, 0x29
_AGED = struct.Struct("<Bd")
# Cache sizes: enough until the last browser has got a sample.
_MOST_STATES, _MOST_PICTURES = 256, 16
# Largest write to a connection [bytes]; less for one that is behind, so that newer samples can still replace
# queued ones.
MOST_TOGETHER, MOST_BEHIND = 16 * 1024, 4096
# Reuse encoded ages for this long: the last pages are served shortly after the first.
_SAME_AGE_S = 0.005


class SampleBatch:
    """Samples of state that arrived together, encoded once for every page that watches them.

    Attributes:
        samples: In order of arrival.
        overtaken: Number of older samples that were dropped for these.
    """

    def __init__(self, samples: list[Sample], overtaken: int = 0) -> None:
        self.samples, self.overtaken = samples, overtaken
        self._with_age = bytearray()
        # Offsets of the ages, and the time each is counted from.
        self._ages: list[tuple[int, float]] = []
        self._frames, self._at = b"", 0.0

    def frames(self) -> bytes:
        """Return the WebSocket frames of all samples."""
        now = time.monotonic()
        if now - self._at > _SAME_AGE_S:
            if not self._with_age:
                self._encode()
            for at, since in self._ages:
                _AGED.pack_into(self._with_age, at, _AGE, now - since)
            self._frames, self._at = bytes(self._with_age), now
        return self._frames

    def _encode(self) -> None:
        for sample in self.samples:
            self._with_age += state_frame(sample)
            if sample.live:
                self._ages.append((len(self._with_age) - _AGED.size, sample.received - sample.late_s))


def batches(samples: Iterable[Sample], overtaken: int = 0) -> Iterator[SampleBatch]:
    """Split samples into pieces that fit one write; the first piece has the number of overtaken samples."""
    together: list[Sample] = []
    size = 0
    for sample in samples:
        if together and size + len(sample.payload) > MOST_BEHIND:
            yield SampleBatch(together, overtaken)
            together, size, overtaken = [], 0, 0
        together.append(sample)
        size += len(sample.payload)
    if together:
        yield SampleBatch(together, overtaken)


def frame(message: bytes) -> bytes:
    """Return a message of the page's protocol as a WebSocket frame."""
    return Frame(Opcode.BINARY, message).serialize(mask=False)


def state_frame(sample: Sample) -> bytes:
    """Return the frame of a state sample: payload, attachment, and age if known."""
    return _with_age(_state_without_age(sample), sample)


def video_frame(sample: Sample, *, key: str, step: int) -> bytes:
    """Return the frame of a picture.

    Args:
        key: Key that the page watches.
        step: Reduction of the view.
    """
    return _with_age(_picture_without_age(sample, key, step), sample)


def _with_age(framed: bytes, sample: Sample) -> bytes:
    if not sample.live:
        return framed
    return framed + _AGED.pack(_AGE, time.monotonic() - sample.received + sample.late_s)


@functools.lru_cache(_MOST_STATES)
def _state_without_age(sample: Sample) -> bytes:
    return _encode_without_age(sample, sample.key, 0)


@functools.lru_cache(_MOST_PICTURES)
def _picture_without_age(sample: Sample, key: str, step: int) -> bytes:
    return _encode_without_age(sample, key, step)


def _encode_without_age(sample: Sample, key: str, step: int) -> bytes:
    """Encode a frame without the age at its end; the frame's length includes the age."""
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
