"""Threads for encoding: each stream keeps one, so its pictures stay in order."""

import asyncio
import os
from collections import Counter
from collections.abc import Collection, Coroutine, Iterable
from concurrent.futures import Executor
from typing import Any

from renderer.pictures.overlay import Picture
from renderer.pictures.post_processing import EncodedPicture, PictureJob, PostProcessor
from renderer.scene.cameras import Camera

# More do not help: drawing and overlay share Python's lock, and with a GPU a process gets to some 100
# pictures of 1280 x 720 a second. x264 encodes 130 a second in one thread.
_MOST = 8


def thread_count() -> int:
    """Return how many encoding threads this process should have: one for every two of its cores."""
    return min(max(len(os.sched_getaffinity(0)) // 2, 1), _MOST)


class EncodingThread:
    """A thread with the encoders of its streams, and at most one picture under way for the video."""

    def __init__(self, executor: Executor, post_processor: PostProcessor) -> None:
        self._executor, self._post_processor = executor, post_processor
        self._under_way: asyncio.Task[None] | None = None

    async def process(self, picture: Picture, camera: Camera, job: PictureJob) -> EncodedPicture:
        """Write the overlay on a picture and encode it."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._executor, self._post_processor.process, picture, camera, job)

    async def start(self, rest: Coroutine[Any, Any, None]) -> None:
        """Run what follows a drawn picture, after the thread's last picture; return when it has begun."""
        try:
            if self._under_way is not None:
                await self._under_way
        except asyncio.CancelledError:
            rest.close()  # avoids a warning: the coroutine is never started
            raise
        self._under_way = asyncio.create_task(rest)

    def end(self, stream: str) -> None:
        """Release a stream's encoder."""
        self._executor.submit(self._post_processor.end, stream)


class EncodingThreads:
    """The assignment of streams to encoding threads, from a stream's first picture to its end."""

    def __init__(self, threads: Iterable[EncodingThread]) -> None:
        self._threads = tuple(threads)
        self._of: dict[str, EncodingThread] = {}

    def of(self, stream: str) -> EncodingThread:
        """Return the stream's thread; a new stream gets the one with the fewest streams."""
        thread = self._of.get(stream)
        if thread is None:
            streams = Counter(self._of.values())
            thread = self._of[stream] = min(self._threads, key=lambda each: streams[each])
        return thread

    def end(self, stream: str) -> None:
        """Release a stream's encoder."""
        thread = self._of.pop(stream, None)
        if thread is not None:
            thread.end(stream)

    def keep(self, streams: Collection[str]) -> None:
        """Release the encoders of all other streams."""
        for stream in self._of.keys() - set(streams):
            self.end(stream)
