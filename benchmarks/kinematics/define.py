"""Response time of Define's checks: the worker's start, then one check for each keystroke.

./dev run python -m benchmarks define [--robot puma560] [--checks 300] [--json]
"""

import statistics
import tempfile
import time
from pathlib import Path
from typing import Any

from robots.descriptions.description import LIBRARY
from robots.descriptions.save_description import read_robot
from services.console.define.store import lay_out, open_store, put
from services.console.define.worker_pool import Limits, Workshop


async def measure(robot: str = "puma560", checks: int = 300) -> dict[str, float]:
    """Return the times [ms] of the first check, with the worker's start, and of the later checks."""
    values, paths = read_robot(LIBRARY / robot)
    with tempfile.TemporaryDirectory() as folder:
        store = open_store(Path(folder) / "store")
        files = {path: put(store, file.read_bytes()) for path, file in paths.items()}
        workshop = Workshop(store.folder, Limits())
        times = []
        try:
            for _ in range(checks + 1):
                begun = time.perf_counter()
                request: dict[str, Any] = {"description": values, "joints": None}
                await workshop.quick.run("check", lay_out(store, files), request)
                times.append((time.perf_counter() - begun) * 1e3)
        finally:
            await workshop.close()
    first, *rest = times
    return {
        "first_ms": first,
        "median_ms": statistics.median(rest),
        "p99_ms": statistics.quantiles(rest, n=100)[98],
    }
