"""Confinement of the worker: it may open its draft, the store and program code only.

A shape file may refer to others (Inline, materials, textures), and a description to its meshes; no reference
may open one of the server's own files. Readers check these paths as well; this module covers all of them.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_NEVER = ("socket.connect", "socket.bind", "os.system", "os.exec")
# Python 3.13 begins a process by both, earlier versions by the first.
_BEGINS = ("subprocess.Popen", "os.posix_spawn")


def confine(folder: Path) -> None:
    """Confine this process to files below the folder and program code, without network.

    It may start only this Python, which reads STEP files.

    Everything else raises PermissionError. This cannot be undone.
    """
    own = (os.path.realpath(folder),)
    packages = Path(__file__).parents[3]
    ours = [str(packages / name) for name in ("robomesh", "robots", "services")]
    code = tuple(map(os.path.realpath, [sys.prefix, sys.base_prefix, sys.base_exec_prefix, *ours]))

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            if not isinstance(path, int) and not _allowed(os.fsdecode(path), flags or 0, own, code):
                raise PermissionError(1, "is outside of the robot's folder", os.fsdecode(path))
        elif event in _NEVER or (event in _BEGINS and os.fsdecode(arguments[0]) != sys.executable):
            raise PermissionError(1, f"{event} is not allowed in this process")

    sys.addaudithook(hook)


def _allowed(path: str, flags: int, own: Sequence[str], code: Sequence[str]) -> bool:
    if path == os.devnull:
        return True
    roots = own if flags & _WRITING else (*own, *code)
    real = os.path.realpath(path)
    return any(real == root or real.startswith(root + os.sep) for root in roots)
