"""Passwords: which are good enough, and how they are kept.

Kept as argon2id (RFC 9106: 64 MiB, three passes, one lane). Verifying is as
expensive for a name that nobody has, so that an answer's time tells no names; one at a time, and a few
may wait, so that a flood of sign-ins takes neither memory nor the console's own time.
"""

import asyncio
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

from services.console.errors import AccountsError, SignInBusyError

Result = TypeVar("Result")

SHORTEST = 10
_LONGEST = 256
_FEWEST_DIFFERENT = 5
_MOST_WAITING = 8

# What common passwords are made of, once digits, punctuation and the usual disguises are taken off.
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
    """The password itself, where it may be one: length counts, not kinds of characters.

    Raises:
        AccountsError: Why not, and what would be right; never with the password in it.
    """
    if len(password) < SHORTEST:
        raise AccountsError(
            f"the password is too short: {SHORTEST} characters at least, a few words are good", "short"
        )
    if len(password.encode(errors="surrogatepass")) > _LONGEST:
        raise AccountsError(f"the password is too long: {_LONGEST} bytes at most", "long")
    if any(ord(each) < 32 or 0xD800 <= ord(each) < 0xE000 for each in password):
        raise AccountsError("the password holds a control character: leave it out", "control")
    folded = password.casefold()
    if len(set(folded)) < _FEWEST_DIFFERENT:
        raise AccountsError("the password repeats a few characters: a few words are good", "repeats")
    if any(folded in run or folded in run[::-1] for run in _RUNS):
        raise AccountsError("the password is a run of neighbours: a few words are good", "run")
    ending = re.sub(r"[\W\d_]+$", "", folded)
    cores = {_core(folded), _core(folded.translate(_DISGUISED)), _core(ending.translate(_DISGUISED))}
    if cores & (_COMMON | {name.casefold(), site.casefold()}) or not _core(folded):
        raise AccountsError(
            "the password is one that is tried first: a common word or a name, and digits; "
            "a few words are good",
            "common",
        )
    return password


def _core(text: str) -> str:
    return re.sub(r"[\W\d_]+", "", text)


@cache
def _hasher() -> PasswordHasher:
    # One lane: a sign-in takes one core from whatever else must be in time there.
    return PasswordHasher(time_cost=3, memory_cost=64 * 1024, parallelism=1)


@cache
def _nobodys() -> str:
    return _hasher().hash("nobody signs in with this")


def hash_password(password: str) -> str:
    """What is kept of a password."""
    return _hasher().hash(password)


def verify(hashed: str | None, password: str) -> bool:
    """Whether a password is the one that was kept; takes as long where none was (None)."""
    try:
        _hasher().verify(_nobodys() if hashed is None else hashed, password)
    except (VerificationError, InvalidHashError, UnicodeEncodeError):
        return False
    return hashed is not None


class Verifier:
    """Hashes and verifies beside the event loop, one after another, a few waiting."""

    def __init__(self) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="password")
        self._waiting = 0

    async def verify(self, hashed: str | None, password: str) -> bool:
        """As `verify`.

        Raises:
            SignInBusyError: If too many wait.
        """
        return await self._do(verify, hashed, password)

    async def hash(self, password: str) -> str:
        """As `hash_password`.

        Raises:
            SignInBusyError: If too many wait.
        """
        return await self._do(hash_password, password)

    def check_free(self) -> None:
        """Whether another has a place now.

        Raises:
            SignInBusyError: If too many wait.
        """
        if self._waiting >= _MOST_WAITING:
            raise SignInBusyError(f"{_MOST_WAITING} passwords are being looked at: try again in a moment")

    async def _do(self, work: Callable[..., Result], *values: str | None) -> Result:
        self.check_free()
        self._waiting += 1
        try:
            return await asyncio.get_running_loop().run_in_executor(self._thread, work, *values)
        finally:
            self._waiting -= 1

    def close(self) -> None:
        """Ends the thread."""
        self._thread.shutdown(wait=False, cancel_futures=True)
