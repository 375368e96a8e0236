"""What waits for one browser, or is held for those still to come: per key, and never a queue.

State: the newest value, and what came just before it. Lists (events, audit): the last few, in order.
Video: the frames since a key frame; who falls behind goes on at the next key frame.
"""

import functools
import time
from collections import deque
from collections.abc import Sequence
from typing import Protocol

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from robomesh.h264 import is_key_frame
from robomesh.header import Header
from robomesh.subscription import Sample
from robomesh.topics import History, Topic

LIST_LENGTH = 200
# About two seconds of video: longer than the interval of key frames is late for ever.
_MOST_FRAMES = 75
# A key frame lets a browser that is this far behind skip what it has not been sent.
_SKIP_FROM = 6

# A stall of the machine, not a slow line: at 100 Hz five states.
_RECENT_S, _MOST_RECENT = 0.05, 8
# How far behind a page may draw.
_SHOWN_S = 0.1


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


class RecentLane:
    """State, on its way: all of the last moment, so that a burst passes whole; of older ones the newest."""

    def __init__(self) -> None:
        self._samples: deque[Sample] = deque(maxlen=_MOST_RECENT)

    def push(self, sample: Sample) -> None:
        """Takes the newest."""
        self._samples.append(sample)

    def pop(self) -> Sample | None:
        """The oldest of the last moment, or the newest."""
        since = time.monotonic() - _RECENT_S
        while len(self._samples) > 1 and self._samples[0].received < since:
            self._samples.popleft()
        return self._samples.popleft() if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """What waits."""
        return tuple(self._samples)


class ListLane:
    """Entries in order. The list that a publisher answers with replaces all entries before it.

    After an outage `Subscription` cuts the list of the same publisher to its new entries: these are appended.
    """

    def __init__(self) -> None:
        self._samples: deque[Sample] = deque(maxlen=LIST_LENGTH)

    def push(self, sample: Sample) -> None:
        """Takes an entry, or a list."""
        if not sample.live and not (self._samples and _goes_on(self._samples[-1].header, sample.header)):
            self._samples.clear()
        self._samples.append(sample)

    def pop(self) -> Sample | None:
        """The oldest."""
        return self._samples.popleft() if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """All."""
        return tuple(self._samples)


def _goes_on(before: Header, header: Header) -> bool:
    """Whether a list holds only entries that are newer than the last sample."""
    return header.publisher == before.publisher and header.sequence > before.sequence


class VideoLane:
    """Frames that can be decoded: from a key frame on, without a gap.

    Attributes:
        starved: Frames come, but none can be sent before the next key frame.
    """

    def __init__(self) -> None:
        self._samples: deque[tuple[float, Sample]] = deque()
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
        self._samples.append((time.monotonic(), sample))
        if len(self._samples) > _MOST_FRAMES:
            self.skip()
            self.starved = True

    def pop(self) -> Sample | None:
        """The oldest frame."""
        return self._samples.popleft()[1] if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """Frames since the last key frame."""
        return tuple(sample for _, sample in self._samples)

    def waited_s(self) -> float:
        """How long the oldest frame has been waiting here [s]."""
        return time.monotonic() - self._samples[0][0] if self._samples else 0.0

    def skip(self) -> None:
        """Throws away what waits: it goes on at the next key frame."""
        self._samples.clear()
        self._gap = True


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
            return NewestLane() if hold else RecentLane()


def thinned(topic: Topic, samples: Sequence[Sample]) -> Sequence[Sample]:
    """What came together, without the state that is old for a display and has a newer."""
    since = time.monotonic() - _SHOWN_S
    if topic.history is not History.LAST or not samples or samples[0].received > since:
        return samples
    newest = {sample.key: sample for sample in samples}
    return [each for each in samples if each.received > since or newest[each.key] is each]


@functools.lru_cache(64)  # every page that watches a picture asks
def begins_video(sample: Sample) -> bool:
    """Whether a decoder can begin with this sample: a key frame, or the frames since one."""
    return not sample.live or is_key_frame(CompressedVideo.FromString(sample.payload).data)
