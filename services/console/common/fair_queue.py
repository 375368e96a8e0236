"""A queue that serves askers in turn, so that an asker's many jobs delay only its own."""

from collections import OrderedDict, deque
from typing import Generic, TypeVar

Job = TypeVar("Job")


class AskerQueue(Generic[Job]):
    """Queued jobs, grouped by asker. No I/O and no clock."""

    def __init__(self) -> None:
        self._askers: OrderedDict[str, deque[Job]] = OrderedDict()

    def __len__(self) -> int:
        return sum(map(len, self._askers.values()))

    def count(self, asker: str) -> int:
        """Return how many jobs of an asker wait."""
        return len(self._askers.get(asker, ()))

    def fullest(self) -> str:
        """Return the asker with the most jobs; there must be one."""
        return max(self._askers, key=self.count)

    def add(self, asker: str, job: Job) -> None:
        """Queue a job behind the asker's others."""
        self._askers.setdefault(asker, deque()).append(job)

    def take(self) -> Job | None:
        """Remove and return the oldest job of the next asker; None if the queue is empty."""
        if not self._askers:
            return None
        asker, jobs = next(iter(self._askers.items()))
        job = jobs.popleft()
        # To the end: the other askers are next, even if this one queues another job immediately.
        self._askers.move_to_end(asker)
        self._forget_empty(asker)
        return job

    def remove_newest(self, asker: str) -> Job:
        """Remove and return the newest job of an asker, who must have one."""
        job = self._askers[asker].pop()
        self._forget_empty(asker)
        return job

    def _forget_empty(self, asker: str) -> None:
        if not self._askers[asker]:
            del self._askers[asker]
