"""The entry of `robomesh`: it can be interrupted from its first moment.

Loading takes up to seconds. Ctrl-C meanwhile would show the place in an import where it happened to come.
"""

import os
import signal
from types import FrameType

_INTERRUPTED = 130


def main() -> None:
    """Load the commands and run the one that is asked for; Ctrl-C while they load ends with status 130."""
    before = signal.signal(signal.SIGINT, _end)
    from services.command_line import main as program

    # Nothing is to be tidied up before; from here on the commands do it themselves.
    signal.signal(signal.SIGINT, before)
    program.main()


def _end(_: int, __: FrameType | None) -> None:
    os._exit(_INTERRUPTED)


if __name__ == "__main__":
    main()
