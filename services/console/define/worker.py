"""Worker process that reads untrusted files for the console: `python -m services.console.define.worker`."""

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

from robomesh.worker import answer_all

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
    from robots.errors import DescriptionError, RobotError
    from services.console.define.errors import RefusedRequest
    from services.console.define.jobs import JOBS
    from services.console.define.sandbox import confine
    from services.console.define.store import Store

    store = Store(store_folder)
    confine(store_folder)

    def answer(job: Job) -> dict[str, Any]:
        name, folder, request = job
        try:
            return JOBS[name](store, folder, request)
        except DescriptionError as error:
            text = "\n".join(error.problems)
        except (RobotError, RefusedRequest) as error:
            text = str(error)
        except PermissionError as error:
            text = f"{error.filename}: {error.strerror}"
        except MemoryError:
            text = f"reading it takes more than {most_bytes / 1024**3:g} GB of memory"
        except RecursionError:
            text = "it is nested too deeply to read"
        except Exception as error:
            import traceback

            traceback.print_exc()
            text = f"an internal error of robomesh; see the console's log: {error!r}"[:300]
        raise RefusedRequest(422, _relative_paths(text, folder))

    return answer


def _relative_paths(text: str, folder: Path) -> str:
    """Return a text with paths relative to the robot's folder, as the page knows them."""
    return text.replace(f"{folder}{os.sep}", "").replace(str(folder), "robot.toml")


if __name__ == "__main__":
    answer_all(begin)
