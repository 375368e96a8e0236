"""Memory and time limits for commands that read files from strangers; the same as for Define's workers."""

import os
import threading
from typing import NoReturn

from robomesh.files.memory_limit import MEMORY_BYTES, limit_memory
from services.command_line.terminal.output import print_line

LONGEST_S = 180.0
# These commands spend their time on the file that they read; others may run for days.
_LIMITED = ("mesh", "robot", "shapes")
_WAIT_FOR_A_PERSON = (("robot", "verify"),)
_LIMITED_IN_MEMORY = (*_LIMITED, "program", "fk", "ik")


def limit(*words: str, most_bytes: int = MEMORY_BYTES, longest_s: float = LONGEST_S) -> None:
    """Limit this process until its end, if the command of these words reads files."""
    command = next(iter(words), "")
    if command in _LIMITED_IN_MEMORY:
        limit_memory(most_bytes)
    if command in _LIMITED and words[:2] not in _WAIT_FOR_A_PERSON:
        clock = threading.Timer(longest_s, _exit, (longest_s,))
        clock.daemon = True
        clock.start()


def _exit(longest_s: float) -> NoReturn:
    print_line(f"robomesh: this took more than {longest_s:g} s and was ended", err=True)
    os._exit(2)
