"""The queue of passwords that wait to be verified: addresses take turns, and names take turns in each.

Whoever sends many tries at once delays, and displaces, the own ones alone. No I/O and no clock.
"""

from collections import OrderedDict, deque
from typing import Generic, TypeVar

from services.console.errors import SignInBusyError

Job = TypeVar("Job")

# Tries that may wait: in all, of one address, and of one name at that address.
MOST_WAITING, MOST_OF_ADDRESS, MOST_OF_NAME = 64, 16, 4

_Names = OrderedDict[str, deque[Job]]


class SignInQueue(Generic[Job]):
    """Jobs by address and name, taken in turn."""

    def __init__(self) -> None:
        self._addresses: OrderedDict[str, _Names[Job]] = OrderedDict()

    def __len__(self) -> int:
        return sum(self._of_address(address) for address in self._addresses)

    def add(self, job: Job, *, address: str, name: str) -> Job | None:
        """Queue a job; return the one that lost its place to it, if any.

        When the queue is full, the address with the most jobs loses its newest, and within a full address
        the name with the most.

        Raises:
            SignInBusyError: If this address, or this name there, has the most jobs itself.
        """
        own, displaced = self._of_name(address, name), None
        if own >= MOST_OF_NAME:
            raise busy()
        if self._of_address(address) >= MOST_OF_ADDRESS:
            if self._of_name(address, self._fullest_name(address)) <= own + 1:
                raise busy()
            displaced = self._remove_newest(address)
        elif len(self) >= MOST_WAITING:
            fullest = max(self._addresses, key=self._of_address)
            if self._of_address(fullest) <= self._of_address(address) + 1:
                raise busy()
            displaced = self._remove_newest(fullest)
        self._addresses.setdefault(address, OrderedDict()).setdefault(name, deque()).append(job)
        return displaced

    def take(self) -> Job | None:
        """Remove and return the next job, of the next address its next name's; None: there is none."""
        if not self._addresses:
            return None
        address = next(iter(self._addresses))
        names = self._addresses[address]
        name, jobs = next(iter(names.items()))
        job = jobs.popleft()
        # To the end: the others come first, also before whoever has one job only and sends the next at once.
        self._addresses.move_to_end(address)
        names.move_to_end(name)
        self._forget_empty(address, name)
        return job

    def _remove_newest(self, address: str) -> Job:
        name = self._fullest_name(address)
        job = self._addresses[address][name].pop()
        self._forget_empty(address, name)
        return job

    def _fullest_name(self, address: str) -> str:
        return max(self._addresses[address], key=lambda name: self._of_name(address, name))

    def _forget_empty(self, address: str, name: str) -> None:
        names = self._addresses[address]
        if not names[name]:
            del names[name]
        if not names:
            del self._addresses[address]

    def _of_address(self, address: str) -> int:
        return sum(map(len, self._addresses[address].values())) if address in self._addresses else 0

    def _of_name(self, address: str, name: str) -> int:
        return len(self._addresses[address].get(name, ())) if address in self._addresses else 0


def busy() -> SignInBusyError:
    """Return the refusal of a try that has no place."""
    return SignInBusyError("too many passwords wait to be verified: try again in a moment")
