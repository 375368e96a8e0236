"""The process that reads untrusted files for the console: one line per request, one line per answer.

It may hang, exhaust memory or crash: `services.console.define.worker_pool` stops it and starts another.

    {"job": "mesh", "folder": ..., "request": {...}}
    {"done": {...}}   or   {"refused": "sentence"}
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
    """Run the worker; arguments: parent's process id, the store's folder, memory limit [bytes]."""
    parent, folder, most_bytes = int(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        return
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal's Ctrl-C stops the console
    # Libraries print to standard output, so answers use another descriptor.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_DATA, (most_bytes, most_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    from services.console.define import jobs
    from services.console.define.sandbox import confine
    from services.console.define.store import Store

    store = Store(folder)
    confine(folder)
    _send(answers, {"done": {}})
    for line in sys.stdin:
        _send(answers, _answer(jobs.JOBS, store, json.loads(line), most_bytes))


def _answer(all_jobs: Any, store: Any, asked: dict[str, Any], most_bytes: int) -> dict[str, Any]:
    from robots.errors import DescriptionError, RobotError
    from services.console.define.errors import RefusedRequest

    folder = Path(asked["folder"])
    try:
        return {"done": all_jobs[asked["job"]](store, folder, asked["request"])}
    except DescriptionError as error:
        return {"refused": _relative_paths("\n".join(error.problems), folder)}
    except (RobotError, RefusedRequest) as error:
        return {"refused": _relative_paths(str(error), folder)}
    except PermissionError as error:
        return {"refused": _relative_paths(f"{error.filename}: {error.strerror}", folder)}
    except MemoryError:
        return {"refused": f"reading it takes more than {most_bytes / 1024**3:g} GB of memory"}
    except RecursionError:
        return {"refused": "it is nested too deeply to read"}
    except Exception as error:
        import traceback

        traceback.print_exc()
        return {"refused": f"an internal error of robomesh; see the console's log: {error!r}"[:300]}


def _relative_paths(text: str, folder: Path) -> str:
    """Return a text with paths relative to the robot's folder, as the page knows them."""
    return text.replace(f"{folder}{os.sep}", "").replace(str(folder), "robot.toml")


def _send(answers: Any, answer: dict[str, Any]) -> None:
    with contextlib.suppress(BrokenPipeError):
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


if __name__ == "__main__":
    main()
