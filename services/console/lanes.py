"""What waits for one browser, or is held for those still to come: per key, and never a queue.

State: the newest value. Lists (events, audit): the last few, in order. Video: the frames since
a key frame; who falls behind goes on at the next key frame.
"""

from collections import deque
from typing import Protocol

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from bus.subscription import Sample
from bus.topics import History, Topic

LIST_LENGTH = 200
# About two seconds of video: longer than the interval of key frames is late for ever.
_MOST_FRAMES = 75
# A key frame lets a browser that is this far behind skip what it has not been sent.
_SKIP_FROM = 6

_NAL_IDR, _NAL_SPS = 5, 7


class Lane(Protocol):
    """Samples of one key, on their way."""

    def push(self, sample: Sample) -> None:
        """Takes a sample; may drop older ones."""

    def pop(self) -> Sample | None:
        """The next to send; None: nothing waits."""

    def held(self) -> tuple[Sample, ...]:
        """What is there now, in order."""


class NewestLane:
    """State: a new value replaces one that was not sent."""

    def __init__(self) -> None:
        self._sample: Sample | None = None

    def push(self, sample: Sample) -> None:
        """Takes the newest."""
        self._sample = sample

    def pop(self) -> Sample | None:
        """The newest, once."""
        sample, self._sample = self._sample, None
        return sample

    def held(self) -> tuple[Sample, ...]:
        """The newest."""
        return () if self._sample is None else (self._sample,)


class ListLane:
    """Entries in order. The list that a publisher answered with stands for all before it."""

    def __init__(self) -> None:
        self._samples: deque[Sample] = deque(maxlen=LIST_LENGTH)

    def push(self, sample: Sample) -> None:
        """Takes an entry, or a list that begins anew."""
        if not sample.live:
            self._samples.clear()
        self._samples.append(sample)

    def pop(self) -> Sample | None:
        """The oldest."""
        return self._samples.popleft() if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """All."""
        return tuple(self._samples)


class VideoLane:
    """Frames that can be decoded: from a key frame on, without a gap.

    Attributes:
        starved: Frames come, but none can be sent before the next key frame.
    """

    def __init__(self) -> None:
        self._samples: deque[Sample] = deque()
        self._gap = True
        self.starved = False

    def push(self, sample: Sample) -> None:
        """Takes a frame, or the frames since the last key frame."""
        if begins_video(sample):
            if self._gap or not sample.live or len(self._samples) >= _SKIP_FROM:
                self._samples.clear()
            self._gap = self.starved = False
        elif self._gap:
            self.starved = True
            return
        self._samples.append(sample)
        if len(self._samples) > _MOST_FRAMES:
            self._samples.clear()
            self._gap = self.starved = True

    def pop(self) -> Sample | None:
        """The oldest frame."""
        return self._samples.popleft() if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """Frames since the last key frame."""
        return tuple(self._samples)


class HeldVideo(VideoLane):
    """The frames that somebody who joins now needs: since the last key frame, sent or not."""

    def push(self, sample: Sample) -> None:
        """As a lane, but a key frame makes all before it useless."""
        if begins_video(sample):
            self._samples.clear()
        super().push(sample)


def lane_for(topic: Topic, *, hold: bool = False) -> Lane:
    """The lane that a topic's samples take.

    Args:
        hold: To keep them for browsers still to come.
    """
    match topic.history:
        case History.LAST_100:
            return ListLane()
        case History.KEY_FRAME:
            return HeldVideo() if hold else VideoLane()
        case _:
            return NewestLane()


def begins_video(sample: Sample) -> bool:
    """Whether a decoder can begin with this sample: a key frame, or the frames since one."""
    return not sample.live or is_key_frame(CompressedVideo.FromString(sample.payload).data)


def is_key_frame(data: bytes) -> bool:
    """Whether an H.264 picture (Annex B) is a key frame: it has parameter sets or an IDR slice."""
    at = data.find(b"\0\0\1")
    while 0 <= at < len(data) - 3:
        kind = data[at + 3] & 0x1F
        if kind in (_NAL_IDR, _NAL_SPS):
            return True
        if kind == 1:  # a slice of another picture: nothing more can follow
            return False
        at = data.find(b"\0\0\1", at + 3)
    return False
