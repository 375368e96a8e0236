"""What the worker may open while it reads somebody's files: its draft, the store, and program code.

A mesh file may name others (Inline, materials, textures), and a description names its meshes; none of
these names may lead the server to a file of its own. Readers check names too; this holds for all of them.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND
_NEVER = ("socket.connect", "socket.bind", "os.system", "os.exec", "os.posix_spawn")


def confine(folder: Path) -> None:
    """From now on this process opens files below the folder, and reads code; it reaches nobody.

    It starts nothing but this same Python, in which STEP files are read.

    Everything else raises PermissionError. There is no way back.
    """
    own = (os.path.realpath(folder),)
    packages = Path(__file__).parents[3]
    ours = [str(packages / name) for name in ("robomesh", "robots", "services")]
    code = tuple(map(os.path.realpath, [sys.prefix, sys.base_prefix, sys.base_exec_prefix, *ours]))

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            path, _, flags = arguments
            if not isinstance(path, int) and not _allowed(os.fsdecode(path), flags or 0, own, code):
                raise PermissionError(1, "is outside of the robot's own files", os.fsdecode(path))
        elif event in _NEVER or (event == "subprocess.Popen" and arguments[0] != sys.executable):
            raise PermissionError(1, f"{event} is not for this process")

    sys.addaudithook(hook)


def _allowed(path: str, flags: int, own: Sequence[str], code: Sequence[str]) -> bool:
    if path == os.devnull:
        return True
    roots = own if flags & _WRITING else (*own, *code)
    real = os.path.realpath(path)
    return any(real == root or real.startswith(root + os.sep) for root in roots)
