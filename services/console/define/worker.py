"""The process that reads other people's files for the console: a request a line in, an answer a line out.

It may hang, grow or die over any of them: `services.console.define.worker_pool` ends it and starts another.

    {"job": "mesh", "folder": ..., "request": {...}}
    {"done": {...}}   or   {"refused": "words"}
"""

import contextlib
import ctypes
import json
import os
import resource
import signal
import sys
from pathlib import Path
from typing import Any

_PR_SET_PDEATHSIG = 1


def main() -> None:
    """The program: parent's process id, the store's folder, most bytes of memory."""
    parent, folder, most_bytes = int(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's Ctrl-C is for the console
    # The libraries talk on standard output; answers have a line of their own.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, most_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    from services.console.define import jobs
    from services.console.define.sandbox import confine
    from services.console.define.store import Store

    store = Store(folder)
    confine(folder)
    _say(answers, {"done": {}})
    for line in sys.stdin:
        _say(answers, _answer(jobs.JOBS, store, json.loads(line), most_bytes))


def _answer(all_jobs: Any, store: Any, asked: dict[str, Any], most_bytes: int) -> dict[str, Any]:
    from robots.errors import DescriptionError, RobotError
    from services.console.define.errors import RefusedRequest

    folder = Path(asked["folder"])
    try:
        return {"done": all_jobs[asked["job"]](store, folder, asked["request"])}
    except DescriptionError as error:
        return {"refused": _own_words("\n".join(error.problems), folder)}
    except (RobotError, RefusedRequest) as error:
        return {"refused": _own_words(str(error), folder)}
    except PermissionError as error:
        return {"refused": _own_words(f"{error.filename}: {error.strerror}", folder)}
    except MemoryError:
        return {"refused": f"it takes more than {most_bytes / 1024**3:g} GB of memory to read"}
    except RecursionError:
        return {"refused": "it is nested too deeply to read"}
    except Exception as error:
        import traceback

        traceback.print_exc()
        return {"refused": f"a fault of robomesh itself, the console's log has more: {error!r}"[:300]}


def _own_words(text: str, folder: Path) -> str:
    """As the page knows the files: below the robot's folder, not where they lie on the server."""
    return text.replace(f"{folder}{os.sep}", "").replace(str(folder), "robot.toml")


def _say(answers: Any, answer: dict[str, Any]) -> None:
    with contextlib.suppress(BrokenPipeError):
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
