"""Password rules, and hashing.

Hashes are argon2id (RFC 9106: 64 MiB, three passes, one lane). Verification takes as long for an unknown
name, so that the response time reveals no names. It runs one at a time with a bounded queue
(`sign_in_queue.py`), so that a flood of sign-ins exhausts neither memory nor the event loop.
"""

import asyncio
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from typing import Any, TypeVar

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from robomesh import reason_codes as codes
from services.console.accounts.sign_in_queue import SignInQueue
from services.console.common.errors import AccountsError, SignInBusyError

Result = TypeVar("Result")

SHORTEST = 10
_LONGEST = 256
_FEWEST_DIFFERENT = 5

# Cores of common passwords, without digits, punctuation and usual substitutions.
_COMMON_WORDS = """
password passwort passwd pass admin administrator root user guest login welcome letmein changeme default
secret master superman batman dragon monkey football baseball iloveyou sunshine princess qwerty qwertz
qwertyuiop azerty asdfgh asdfghjkl zxcvbn zxcvbnm qazwsx qazwsxedc abc abcd abcdef abcdefgh test testing
demo robot robots robomesh console operator monitor control factory plant industrial trustno hello
computer internet company woaini mima
"""
_COMMON = frozenset(_COMMON_WORDS.split())
_DISGUISED = str.maketrans("013457@$!", "oieastasi")
_RUNS = ("01234567890123456789", "qwertyuiopasdfghjklzxcvbnm", "abcdefghijklmnopqrstuvwxyz")


def check_password(password: str, *, name: str, site: str = "") -> str:
    """Return the password if it is acceptable: length counts, not kinds of characters.

    Raises:
        AccountsError: With the reason and advice; never with the password.
    """
    if len(password) < SHORTEST:
        raise AccountsError(codes.PASSWORD_SHORT(least=SHORTEST))
    if len(password.encode(errors="surrogatepass")) > _LONGEST:
        raise AccountsError(codes.PASSWORD_LONG(most=_LONGEST))
    if any(ord(each) < 32 or 0xD800 <= ord(each) < 0xE000 for each in password):
        raise AccountsError(codes.PASSWORD_CONTROL())
    folded = password.casefold()
    if len(set(folded)) < _FEWEST_DIFFERENT:
        raise AccountsError(codes.PASSWORD_REPEATS())
    if any(folded in run or folded in run[::-1] for run in _RUNS):
        raise AccountsError(codes.PASSWORD_RUN())
    ending = re.sub(r"[\W\d_]+$", "", folded)
    cores = {_core(folded), _core(folded.translate(_DISGUISED)), _core(ending.translate(_DISGUISED))}
    if cores & (_COMMON | {name.casefold(), site.casefold()}) or not _core(folded):
        raise AccountsError(codes.PASSWORD_COMMON())
    return password


def _core(text: str) -> str:
    return re.sub(r"[\W\d_]+", "", text)


@cache
def _hasher() -> PasswordHasher:
    # One lane: a sign-in uses one core, and leaves the others to services with deadlines.
    return PasswordHasher(time_cost=3, memory_cost=64 * 1024, parallelism=1)


@cache
def _dummy_hash() -> str:
    return _hasher().hash("nobody signs in with this")


def hash_password(password: str) -> str:
    """Return the hash of a password."""
    return _hasher().hash(password)


def verify(hashed: str | None, password: str) -> bool:
    """Return whether a password matches a hash; takes as long without a hash (None)."""
    try:
        _hasher().verify(_dummy_hash() if hashed is None else hashed, password)
    except (VerificationError, InvalidHashError, UnicodeEncodeError):
        return False
    return hashed is not None


@dataclass(eq=False)
class _Job:
    """Work for the thread, and the future of its result."""

    work: Callable[[], Any]
    done: asyncio.Future[Any]


class Verifier:
    """Hashes and verifies in a thread, one job at a time; addresses and names take turns."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="password")
        self._queue = SignInQueue[_Job]()
        self._serving: asyncio.Task[None] | None = None

    async def verify(self, hashed: str | None, password: str, *, address: str, name: str) -> bool:
        """Verify like `verify`, when it is the turn of this address and name.

        Raises:
            SignInBusyError: If the queue is full.
        """
        return await self._do(partial(verify, hashed, password), address, name)

    async def hash(self, password: str, *, address: str, name: str) -> str:
        """Hash like `hash_password`, when it is the turn of this address and name.

        Raises:
            SignInBusyError: If the queue is full.
        """
        return await self._do(partial(hash_password, password), address, name)

    async def _do(self, work: Callable[[], Result], address: str, name: str) -> Result:
        job = _Job(work, asyncio.get_running_loop().create_future())
        displaced = self._queue.add(job, address=address, name=name)
        if displaced is not None and not displaced.done.done():
            displaced.done.set_exception(SignInBusyError())
        if self._serving is None or self._serving.done():
            self._serving = asyncio.create_task(self._serve())
        result: Result = await job.done
        return result

    async def _serve(self) -> None:
        loop = asyncio.get_running_loop()
        while (job := self._queue.take()) is not None:
            if job.done.done():
                continue  # cancelled
            try:
                result = await loop.run_in_executor(self._thread, job.work)
            except Exception as error:
                if not job.done.done():
                    job.done.set_exception(error)
                continue
            if not job.done.done():
                job.done.set_result(result)

    def close(self) -> None:
        """Stop the thread."""
        if self._serving is not None:
            self._serving.cancel()
        self._thread.shutdown(wait=False, cancel_futures=True)
