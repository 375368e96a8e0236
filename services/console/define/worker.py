"""Worker process that reads untrusted files for the console: `python -m services.console.define.worker`.

An answer is `{"done": {...}}` or `{"refused": {"code": ..., "values": {...}, "text": "sentence"}}`.
"""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robomesh.files.worker import answer_all

Job = tuple[str, Path, dict[str, Any]]


def begin(settings: tuple[Path, Path, int]) -> Callable[[Job], dict[str, Any]]:
    """Return the function that does jobs: a name in `JOBS`, the draft's folder, and a request.

    Args:
        settings: The store's folder, the folder for temporary files in it, and the memory limit of this
            process [bytes].
    """
    store_folder, temporary, most_bytes = settings
    shutil.rmtree(temporary, ignore_errors=True)  # left by a worker that was killed
    temporary.mkdir()
    os.environ.update(TMPDIR=str(temporary), XDG_CACHE_HOME=str(temporary))
    # Imported after the limit and the environment are set, and before `confine`.
    import numpy as np

    from robomesh import reason_codes as codes
    from robots.schema.errors import DescriptionError, RobotError
    from services.console.common.errors import RefusedRequest
    from services.console.define.jobs import JOBS
    from services.console.define.sandbox import confine
    from services.console.define.store import Store

    store = Store(store_folder)
    # OpenBLAS takes 32 MB at its first use, and ends the process if a file has used up the memory before.
    np.linalg.inv(np.eye(2))
    confine(store_folder)

    def answer(job: Job) -> dict[str, Any]:
        name, folder, request = job
        try:
            return {"done": JOBS[name](store, folder, request)}
        except RefusedRequest as error:
            reason = error.reason
        except DescriptionError as error:
            reason = codes.DEFINE_UNREADABLE(detail=_relative_paths("; ".join(error.problems), folder))
        except RobotError as error:
            reason = codes.DEFINE_UNREADABLE(detail=_relative_paths(str(error), folder))
        except PermissionError as error:
            detail = _relative_paths(f"{error.filename}: {error.strerror}", folder)
            reason = codes.DEFINE_UNREADABLE(detail=detail)
        except MemoryError:
            reason = codes.DEFINE_MEMORY(gigabytes=most_bytes / 1024**3)
        except RecursionError:
            reason = codes.DEFINE_NESTED()
        except Exception as error:
            import traceback

            traceback.print_exc()
            reason = codes.FAILED(request=f"define/{name}", detail=repr(error)[:300])
        return {"refused": {"code": reason.code, "values": dict(reason.values), "text": reason.text}}

    return answer


def _relative_paths(text: str, folder: Path) -> str:
    """Return a text with paths relative to the robot's folder, as the page knows them."""
    return text.replace(f"{folder}{os.sep}", "").replace(str(folder), "robot.toml")


if __name__ == "__main__":
    answer_all(begin)
