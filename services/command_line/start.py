"""The entry point of `robomesh`, which Ctrl-C can end from its first moment.

Imports take up to seconds; without this module, Ctrl-C during an import would print a traceback.
"""

import os
import signal
from types import FrameType

_INTERRUPTED = 130


def main() -> None:
    """Import the program and run it; Ctrl-C during the import ends with status 130."""
    before = signal.signal(signal.SIGINT, _exit)
    # All matrices are small. NumPy's library would start a thread for each core, in each process, and these
    # spin for 0.1 s. Services and workers inherit it.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    from services.command_line import main as program

    # Before this point there is nothing to clean up; from here on the commands handle Ctrl-C.
    signal.signal(signal.SIGINT, before)
    program.main()


def _exit(_: int, __: FrameType | None) -> None:
    os._exit(_INTERRUPTED)


if __name__ == "__main__":
    main()
