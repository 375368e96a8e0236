"""Memory and time limits for commands that read files from strangers; the same as for Define's workers."""

import os
import resource
import sys
import threading
from typing import NoReturn

MOST_BYTES = 6 * 1024**3
LONGEST_S = 180.0
# These commands spend their time on the file that they read; others may run for days.
_LIMITED = ("mesh", "robot")
_LIMITED_IN_MEMORY = (*_LIMITED, "program", "fk", "ik")


def limit(command: str, *, most_bytes: int = MOST_BYTES, longest_s: float = LONGEST_S) -> None:
    """Limit this process until its end, if its command reads files."""
    if command in _LIMITED_IN_MEMORY:
        _, hard = resource.getrlimit(resource.RLIMIT_DATA)
        most = most_bytes if hard == resource.RLIM_INFINITY else min(most_bytes, hard)
        resource.setrlimit(resource.RLIMIT_DATA, (most, hard))
    if command in _LIMITED:
        clock = threading.Timer(longest_s, _exit, (longest_s,))
        clock.daemon = True
        clock.start()


def _exit(longest_s: float) -> NoReturn:
    print(f"robomesh: this took more than {longest_s:g} s and was ended", file=sys.stderr, flush=True)
    os._exit(2)
