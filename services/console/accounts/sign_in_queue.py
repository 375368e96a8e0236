"""A bounded queue of password verifications: addresses take turns, and names take turns within an address.

A client that sends many attempts delays and displaces only its own. No I/O and no clock.
"""

from typing import Generic, TypeVar

from services.console.common.errors import SignInBusyError
from services.console.common.fair_queue import AskerQueue

Job = TypeVar("Job")

# Largest number of queued attempts: in total, for one address, and for one name at an address.
MOST_WAITING, MOST_OF_ADDRESS, MOST_OF_NAME = 64, 16, 4


class SignInQueue(Generic[Job]):
    """Jobs by address and name, served in turn."""

    def __init__(self) -> None:
        # One entry per job, and by address the jobs of its names.
        self._addresses: AskerQueue[str] = AskerQueue()
        self._names: dict[str, AskerQueue[Job]] = {}

    def __len__(self) -> int:
        return len(self._addresses)

    def add(self, job: Job, *, address: str, name: str) -> Job | None:
        """Queue a job; return the one that lost its place to it, if any.

        When the queue is full, the address with the most jobs loses its newest, and within a full address
        the name with the most.

        Raises:
            SignInBusyError: If this address, or this name there, has the most jobs itself.
        """
        names: AskerQueue[Job] = self._names.get(address, AskerQueue())
        own, displaced = names.count(name), None
        if own >= MOST_OF_NAME:
            raise SignInBusyError
        if self._addresses.count(address) >= MOST_OF_ADDRESS:
            if names.count(names.fullest()) <= own + 1:
                raise SignInBusyError
            displaced = self._remove_newest(address)
        elif len(self) >= MOST_WAITING:
            fullest = self._addresses.fullest()
            if self._addresses.count(fullest) <= self._addresses.count(address) + 1:
                raise SignInBusyError
            displaced = self._remove_newest(fullest)
        self._addresses.add(address, address)
        self._names.setdefault(address, names).add(name, job)
        return displaced

    def take(self) -> Job | None:
        """Remove and return the next job: the next address's next name; None if the queue is empty."""
        address = self._addresses.take()
        if address is None:
            return None
        job = self._names[address].take()
        self._forget_empty(address)
        return job

    def _remove_newest(self, address: str) -> Job:
        self._addresses.remove_newest(address)
        names = self._names[address]
        job = names.remove_newest(names.fullest())
        self._forget_empty(address)
        return job

    def _forget_empty(self, address: str) -> None:
        if not self._names[address]:
            del self._names[address]
