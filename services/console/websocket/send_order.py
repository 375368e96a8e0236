"""Order of sending to one page: messages first, then current state, then the send queues in turn.

Samples of state are sent as they arrive. When the connection accepts no more, they wait in send queues, where
newer samples replace older ones, until these are empty.
"""

from collections import deque

from robomesh.contract import topics
from services.console.websocket.adaptive_video import AdaptiveVideo
from services.console.websocket.framing import (
    MOST_BEHIND,
    MOST_TOGETHER,
    SampleBatch,
    frame,
    state_frame,
    video_frame,
)
from services.console.websocket.send_queues import SendQueue, queue_for

# Limit of unread messages to a page [bytes]: a large mesh's presence, and some large answers.
MOST_UNREAD = 4 << 20


class SendOrder:
    """Everything that waits to be sent to one page.

    Attributes:
        overflowed: The page reads too slowly: a message did not fit, and no further one is queued.
        sent: Number of samples sent so far.
    """

    def __init__(self) -> None:
        self._messages: deque[bytes] = deque()
        self._unread = 0
        self._batches: deque[SampleBatch] = deque()
        self._behind = False
        self._queues: dict[str, SendQueue] = {}
        # Send queues and videos with samples; each in turn sends one.
        self._waiting: dict[str, SendQueue | AdaptiveVideo] = {}
        self.overflowed = False
        self.sent = 0

    @property
    def has_messages(self) -> bool:
        """True while a message is queued."""
        return bool(self._messages)

    @property
    def unread_bytes(self) -> int:
        """Size of the queued messages."""
        return self._unread

    def add_message(self, message: bytes) -> None:
        """Queue a message ahead of samples; the page must read all of them."""
        self.overflowed = self.overflowed or self._unread > MOST_UNREAD
        if not self.overflowed:
            self._messages.append(message)
            self._unread += len(message)

    def add_batch(self, batch: SampleBatch) -> None:
        """Queue samples of state."""
        if self._behind:
            self._hold(batch)
        else:
            self._batches.append(batch)

    def add_video(self, key: str, video: AdaptiveVideo) -> None:
        """Queue a video that has a frame."""
        self._waiting[key] = video

    def remove(self, key: str) -> None:
        """Drop the queued samples of a key that the page no longer watches."""
        self._queues.pop(key, None)
        self._waiting.pop(key, None)

    def next_write(self) -> bytes:
        """Return what is written next; empty if nothing is queued."""
        frames: list[bytes] = []
        size = 0
        most = MOST_BEHIND if self._behind else MOST_TOGETHER
        while size < most and (each := self._next()):
            frames.append(each)
            size += len(each)
        return b"".join(frames)

    def hold(self) -> None:
        """Move the samples of state into send queues, because the connection accepts no more."""
        while self._batches:
            self._hold(self._batches.popleft())

    def _next(self) -> bytes:
        """Return the next frame."""
        if self._messages:
            message = self._messages.popleft()
            self._unread -= len(message)
            return frame(message)
        if self._batches:
            batch = self._batches.popleft()
            self.sent += len(batch.samples)
            return batch.frames()
        while self._waiting:
            key = next(iter(self._waiting))
            queue = self._waiting.pop(key)
            sample = queue.pop()
            if sample is None:
                continue
            self._waiting[key] = queue  # after the others
            if isinstance(queue, AdaptiveVideo):
                return video_frame(sample, key=key, step=queue.step)
            self.sent += 1
            return state_frame(sample)
        self._behind = False
        return b""

    def _hold(self, batch: SampleBatch) -> None:
        self._behind = True
        for sample in batch.samples:
            queue = self._queues.get(sample.key)
            if queue is None:
                queue = self._queues[sample.key] = queue_for(topics.topic(sample.parsed.topic))
            queue.push(sample)
            self._waiting[sample.key] = queue
