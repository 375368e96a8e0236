"""Pairs of an arm's links whose hulls touch at home: which may be ignored, and what of the others is checked.

    python -m robots.collision.study KEPT.json < CASE.npz      in a process of its own, with limits

A pair that touches in all sampled positions, as exact meshes too, is ignored. One whose meshes are apart at
home is checked as meshes. What is found is kept in the user's cache by its content; a failure is not kept.
"""

import contextlib
import fcntl
import hashlib
import io
import json
import logging
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robots.collision.sampling import SAMPLES
from robots.collision.surfaces import Surface, Touch
from robots.collision.verdicts import Kind
from robots.glb import cache_folder
from robots.joints import FloatArray

log = logging.getLogger(__name__)

# Part of each name in the cache: counts up when the same case is to give another result.
_VERSION = 3
TIME_LIMIT_S = 120.0
MEMORY_LIMIT = 4 << 30
# A study that failed is tried again after so long [s], then after twice that, and so on.
_AGAIN_S, _LATEST_AGAIN_S = 30.0, 3600.0
# After so many failures also a caller that does not wait gets hulls.
_TRIES = 4


@dataclass(frozen=True, eq=False)
class Case:
    """What a study is made of.

    Attributes:
        pairs: Numbers of two links each.
        checked, drawn: Of each link the triangles (n, 3, 3) of its geometry in its frame [m].
        placements: (samples, links, 4, 4) of the links, home first.
    """

    pairs: tuple[tuple[int, int], ...]
    checked: tuple[FloatArray, ...]
    drawn: tuple[FloatArray, ...]
    placements: FloatArray


def studied(case: Case, *, wait: bool = True) -> tuple[Kind, ...] | None:
    """What is found of each pair of a case, from the cache where it was studied before.

    Args:
        wait: Else a study that takes time goes on in its own process, and None is returned until it has found
            something. One that failed is tried again later: until then waiting gives hulls.
    """
    path = cache_folder().parent / "collision" / f"{_key(case)}.json"
    with contextlib.suppress(OSError, ValueError):
        return _loaded(path.read_bytes())
    failures, again_s = _failed.get(path, (0, 0.0))
    running = _running.get(path)
    if running is None and time.monotonic() >= again_s:
        running = _running[path] = _Study(case, path)
    if running is not None:
        if not wait and not running.ended:
            return None
        del _running[path]
        found = running.result()
        if found is not None:
            _failed.pop(path, None)
            return found
        pause_s = min(_AGAIN_S * 2**failures, _LATEST_AGAIN_S)
        failures += 1
        _failed[path] = failures, time.monotonic() + pause_s
        log.warning("the study of links that touch at home failed; it is tried again in %.0f s", pause_s)
    if not wait and failures < _TRIES:
        return None
    return (Kind.NOT_STUDIED,) * len(case.pairs)


class _Study:
    """A process that studies a case, and ends when it takes too long."""

    def __init__(self, case: Case, path: Path) -> None:
        self._path = path
        with tempfile.TemporaryFile() as given:
            given.write(_stored(case))
            given.seek(0)
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "robots.collision.study", str(path)],
                stdin=given,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )

        # Its processor time is limited inside; a process that waits or swaps is ended here.
        self._until_s = time.monotonic() + 3 * TIME_LIMIT_S

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None or time.monotonic() > self._until_s

    def result(self) -> tuple[Kind, ...] | None:
        """What was found, when the process has ended; None: it failed."""
        try:
            self._process.wait(max(self._until_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        try:
            return _loaded(self._path.read_bytes())
        except (OSError, ValueError):
            return None


_running: dict[Path, _Study] = {}
# How many times a study failed, and when it is tried again.
_failed: dict[Path, tuple[int, float]] = {}


def study(case: Case) -> tuple[Kind, ...]:
    """Study each pair of a case."""
    touch = Touch()
    checked, drawn = ([Surface(each) for each in some] for some in (case.checked, case.drawn))
    return tuple(
        _pair(case, pair, [(some[pair[0]], some[pair[1]]) for some in (checked, drawn)], touch)
        for pair in case.pairs
    )


def _pair(case: Case, pair: tuple[int, int], levels: Sequence[tuple[Surface, Surface]], touch: Touch) -> Kind:
    one, other = (case.placements[:, number] for number in pair)
    places = np.linalg.solve(one, other)
    checked = levels[0]
    if not all(len(surface.triangles) for surface in checked):
        return Kind.NO_SURFACE
    if len(places) >= SAMPLES and all(touch(*checked, place) for place in places):
        return Kind.ALWAYS
    for level, kind in zip(levels, (Kind.COLLISION_MESHES, Kind.VISUAL_MESHES), strict=True):
        if all(len(surface.triangles) for surface in level) and not touch(*level, places[0]):
            return kind
    return Kind.TOUCHING


def _key(case: Case) -> str:
    digest = hashlib.sha256(f"{_VERSION} {case.pairs} {case.placements.shape}".encode())
    # Rounded: another processor's last digit is no other robot.
    for array in (*case.checked, *case.drawn, case.placements[:8]):
        digest.update(f"{array.shape}".encode())
        digest.update((np.round(array, 9) + 0.0).tobytes())
    return digest.hexdigest()


def _stored(case: Case) -> bytes:
    arrays: dict[str, Any] = {"pairs": np.array(case.pairs), "placements": case.placements}
    for name, some in (("checked", case.checked), ("drawn", case.drawn)):
        arrays |= {f"{name}{number}": each for number, each in enumerate(some)}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _given(data: bytes) -> Case:
    with np.load(io.BytesIO(data)) as arrays:
        count = arrays["placements"].shape[1]
        checked, drawn = (
            tuple(arrays[f"{name}{number}"] for number in range(count)) for name in ("checked", "drawn")
        )
        pairs = tuple((one, other) for one, other in arrays["pairs"].tolist())
        return Case(pairs, checked, drawn, arrays["placements"])


def _saved(found: Sequence[Kind]) -> bytes:
    return json.dumps(found).encode()


def _loaded(data: bytes) -> tuple[Kind, ...]:
    return tuple(Kind(kind) for kind in json.loads(data))


def _keep(path: Path, data: bytes) -> None:
    """Write whole or not at all; a folder that cannot be written costs time later, no more."""
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(data)
        Path(file.name).replace(path)


def main() -> None:
    """Study the case on standard input, unless another process just did; what is found goes to the file."""
    path = Path(sys.argv[1])
    path.parent.mkdir(parents=True, exist_ok=True)
    os.nice(5)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    resource.setrlimit(resource.RLIMIT_CPU, (int(TIME_LIMIT_S), int(TIME_LIMIT_S)))
    # The services of a site ask for the same study at the same time.
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.is_file():
            _keep(path, _saved(study(_given(sys.stdin.buffer.read()))))


if __name__ == "__main__":
    main()
