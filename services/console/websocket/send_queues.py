"""Send queues of a browser, and held samples for later browsers: bounded, one for each key.

State: the newest value, and those just before it. Lists (events, audit): the last entries, in order.
Video: the frames since a key frame; a slow browser continues at the next key frame.
"""

import functools
import time
from collections import deque
from collections.abc import Sequence
from typing import Protocol

from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from robomesh.contract.header import Header
from robomesh.contract.topics import History, Topic
from robomesh.publications.subscription import Sample
from robomesh.recordings.h264 import is_key_frame

LIST_LENGTH = 200
# About two seconds of video; longer than the interval of key frames would never catch up.
_MOST_FRAMES = 75
# With this many queued frames, a key frame replaces them.
_SKIP_FROM = 6

# Covers a stall of the machine, at 100 Hz five states; a slow line gets the newest only.
_RECENT_S, _MOST_RECENT = 0.05, 8
# Largest delay of a displayed state.
_SHOWN_S = 0.1


class SendQueue(Protocol):
    """A queue of one key's samples."""

    def push(self, sample: Sample) -> None:
        """Add a sample; may drop older ones."""

    def pop(self) -> Sample | None:
        """Return the next sample to send, or None."""

    def held(self) -> tuple[Sample, ...]:
        """Return the held samples, in order."""


class NewestQueue:
    """A queue of state: a new value replaces an unsent one."""

    def __init__(self) -> None:
        self._sample: Sample | None = None

    def push(self, sample: Sample) -> None:
        """Replace the sample."""
        self._sample = sample

    def pop(self) -> Sample | None:
        """Return the newest sample, once."""
        sample, self._sample = self._sample, None
        return sample

    def held(self) -> tuple[Sample, ...]:
        """Return the newest sample."""
        return () if self._sample is None else (self._sample,)


class RecentQueue:
    """A queue of state that passes a short burst whole, and otherwise keeps the newest."""

    def __init__(self) -> None:
        self._samples: deque[Sample] = deque(maxlen=_MOST_RECENT)

    def push(self, sample: Sample) -> None:
        """Add the newest sample."""
        self._samples.append(sample)

    def pop(self) -> Sample | None:
        """Return the oldest recent sample, or the newest."""
        since = time.monotonic() - _RECENT_S
        while len(self._samples) > 1 and self._samples[0].received < since:
            self._samples.popleft()
        return self._samples.popleft() if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """Return the queued samples."""
        return tuple(self._samples)


class ListQueue:
    """A queue of entries in order; a publisher's full list replaces all entries before it.

    After an outage `Subscription` cuts the list to its new entries; these are appended.
    """

    def __init__(self) -> None:
        self._samples: deque[Sample] = deque(maxlen=LIST_LENGTH)

    def push(self, sample: Sample) -> None:
        """Add an entry or a list."""
        if not sample.live and not (self._samples and _continues(self._samples[-1].header, sample.header)):
            self._samples.clear()
        self._samples.append(sample)

    def pop(self) -> Sample | None:
        """Return the oldest sample."""
        return self._samples.popleft() if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """Return all samples."""
        return tuple(self._samples)


def _continues(before: Header, header: Header) -> bool:
    """Return whether a list continues after the last sample."""
    return header.publisher == before.publisher and header.sequence > before.sequence


class VideoQueue:
    """A queue of decodable frames: from a key frame on, without a gap.

    Attributes:
        starved: Frames arrive, but none can be sent before the next key frame.
    """

    def __init__(self) -> None:
        self._samples: deque[tuple[float, Sample]] = deque()
        self._gap = True
        self.starved = False

    def push(self, sample: Sample) -> None:
        """Add a frame, or all frames since the last key frame."""
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
        """Return the oldest frame."""
        return self._samples.popleft()[1] if self._samples else None

    def held(self) -> tuple[Sample, ...]:
        """Return the frames since the last key frame."""
        return tuple(sample for _, sample in self._samples)

    def waited_s(self) -> float:
        """Return how long the oldest frame has waited here [s]."""
        return time.monotonic() - self._samples[0][0] if self._samples else 0.0

    def skip(self) -> None:
        """Drop the queued frames; the video continues at the next key frame."""
        self._samples.clear()
        self._gap = True


class HeldVideoQueue(VideoQueue):
    """The frames since the last key frame, for browsers that join."""

    def push(self, sample: Sample) -> None:
        """Add a frame; a key frame replaces all before it."""
        if begins_video(sample):
            self._samples.clear()
        super().push(sample)


def queue_for(topic: Topic, *, hold: bool = False) -> SendQueue:
    """Return the queue for a topic's samples.

    Args:
        hold: Hold them for browsers that join later.
    """
    match topic.history:
        case History.LAST_100:
            return ListQueue()
        case History.KEY_FRAME:
            return HeldVideoQueue() if hold else VideoQueue()
        case _:
            return NewestQueue() if hold else RecentQueue()


def drop_outdated(topic: Topic, samples: Sequence[Sample]) -> Sequence[Sample]:
    """Return samples without the states that are too old to display and have a newer one."""
    since = time.monotonic() - _SHOWN_S
    if topic.history is not History.LAST or not samples or samples[0].received > since:
        return samples
    newest = {sample.key: sample for sample in samples}
    return [each for each in samples if each.received > since or newest[each.key] is each]


@functools.lru_cache(64)  # called for every viewer of a frame
def begins_video(sample: Sample) -> bool:
    """Return whether a decoder can begin with this sample: a key frame, or all frames since one."""
    return not sample.live or is_key_frame(CompressedVideo.FromString(sample.payload).data)
