"""Processes that use all the CPU that they get, as load."""

import contextlib
import multiprocessing
from collections.abc import Iterator


@contextlib.contextmanager
def burning(count: int) -> Iterator[None]:
    """Run burners while the block runs."""
    processes = [multiprocessing.Process(target=burn, daemon=True) for _ in range(count)]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def burn() -> None:
    """Use the CPU until the parent process ends, also if a signal ends it."""
    parent = multiprocessing.parent_process()
    while parent is not None and parent.is_alive():
        sum(range(100_000))
