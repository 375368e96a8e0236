"""Study of link pairs with hulls that touch at home or often: which to ignore, which to check as surfaces.

    python -m robots.bodies.pair_study RESULT.json < CASE.npz      in a separate process, with limits

A pair is ignored if its exact surfaces touch in all sampled positions. A pair is checked as surfaces if only
its hulls touch at home, or if it is apart there and only its hulls touch in at least 1 % of positions.
Results are in the user's cache, keyed by the case's content; failures are not.
"""

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
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from robomesh.files.atomic_write import write_atomically
from robots.bodies.sampling import SAMPLES
from robots.bodies.surfaces import Surface, Touch
from robots.bodies.verdicts import Kind
from robots.descriptions.glb import cache_folder
from robots.kinematics.joints import FloatArray
from robots.shapes.geometry import IndexArray

log = logging.getLogger(__name__)

# Part of each cache key. Increment it when the same case should give another result.
_VERSION = 4
TIME_LIMIT_S = 120.0
MEMORY_LIMIT = 4 << 30
# Positions in which hulls are tested, and the least number in which only the hulls touch: 1 %.
SURVEYED, FEWEST_FALSE = 400, 4
# After this share of the time limit, pairs that are apart at home stay hulls, so that the study can finish.
_SURVEY_ENDS = 0.75
# Largest sum of the triangles of two surfaces; more would make each check too slow.
MOST_TRIANGLES = 50_000
# Delay before a failed study is repeated; doubled after each failure, up to the maximum.
_RETRY_S, _LONGEST_RETRY_S = 30.0, 3600.0
# After this number of failures, a caller that does not wait gets hulls too.
_TRIES = 4


@dataclass(frozen=True, eq=False)
class Case:
    """The input of a study.

    Attributes:
        pairs: Numbers of two links each.
        checked, drawn: Each link's triangles (n, 3, 3) for checks and for drawing, in its frame [m]; those
            for drawing only if the link touches another at home.
        placements: (samples, links, 4, 4) of the links, home first.
        touching: For each pair that is apart at home, (k,) numbers of the placements in which its hulls
            touch; empty for a pair with hulls that touch at home.
    """

    pairs: tuple[tuple[int, int], ...]
    checked: tuple[FloatArray, ...]
    drawn: tuple[FloatArray, ...]
    placements: FloatArray
    touching: tuple[IndexArray, ...]


class Finding(NamedTuple):
    """A study's result for a pair: its kind, and the share of positions for the kind's text."""

    kind: Kind
    share: float = 0.0


def study_results(case: Case, *, wait: bool = True) -> tuple[Finding, ...] | None:
    """Return the result for each pair of a case, from the cache or from a new study.

    Args:
        wait: Wait for a running study. Otherwise return None until it has ended. A failed study is repeated
            after a delay; until then, a caller that waits gets hulls.
    """
    path = cache_folder().parent / "collision" / f"{_key(case)}.json"
    with _lock:
        found = _cached_results(path, case)
        if found is not None:
            return found
        failures, retry_at_s = _failed.get(path, (0, 0.0))
        running = _running.get(path)
        if running is None and time.monotonic() >= retry_at_s:
            running = _running[path] = _Study(case, path)
    if running is not None:
        if not wait and not running.ended:
            return None
        running.join()
        with _lock:
            found = _cached_results(path, case)
            # Several threads may wait for one study; only the first counts its failure.
            if _running.get(path) is running:
                del _running[path]
                _record_outcome(path, failed=found is None)
            failures, _ = _failed.get(path, (0, 0.0))
        if found is not None:
            return found
    if not wait and failures < _TRIES:
        return None
    # The hulls of a pair that is apart at home are checked anyway.
    return tuple(Finding(Kind.APART if len(each) else Kind.NOT_STUDIED) for each in case.touching)


def _record_outcome(path: Path, *, failed: bool) -> None:
    if not failed:
        _failed.pop(path, None)
        return
    failures, _ = _failed.get(path, (0, 0.0))
    pause_s = min(_RETRY_S * 2**failures, _LONGEST_RETRY_S)
    _failed[path] = failures + 1, time.monotonic() + pause_s
    log.warning("the study of links with touching hulls failed; the next attempt is in %.0f s", pause_s)


class _Study:
    """A process that studies a case, with a time limit."""

    def __init__(self, case: Case, path: Path) -> None:
        with tempfile.TemporaryFile() as file:
            file.write(_encode_case(case))
            file.seek(0)
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "robots.bodies.pair_study", str(path)],
                stdin=file,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )

        # The process limits its CPU time; this limit kills a process that waits or swaps.
        self._until_s = time.monotonic() + 3 * TIME_LIMIT_S

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None or time.monotonic() > self._until_s

    def join(self) -> None:
        """Wait until the process has ended; kill it at its time limit."""
        try:
            self._process.wait(max(self._until_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


# Protects both dictionaries; released while a thread waits for a study.
_lock = threading.Lock()
_running: dict[Path, _Study] = {}
# Number of failures of a study, and the time of the next attempt.
_failed: dict[Path, tuple[int, float]] = {}


def study(case: Case) -> tuple[Finding, ...]:
    """Study each pair of a case, first those with hulls that touch at home."""
    touch = Touch()
    checked, drawn = ([Surface(each) for each in some] for some in (case.checked, case.drawn))
    found: dict[int, Finding] = {}
    for number in sorted(range(len(case.pairs)), key=lambda number: len(case.touching[number]) > 0):
        one, other = case.pairs[number]
        touching = case.touching[number]
        placements = case.placements[touching] if len(touching) else case.placements[:SAMPLES]
        places = np.linalg.solve(placements[:, one], placements[:, other]).astype(np.float64, copy=False)
        if len(touching):
            found[number] = _apart_at_home(places, checked[one], checked[other], touch)
        else:
            levels = [(some[one], some[other]) for some in (checked, drawn)]
            found[number] = Finding(_touching_at_home(places, levels, touch))
    return tuple(found[number] for number in range(len(case.pairs)))


def _touching_at_home(places: FloatArray, levels: Sequence[tuple[Surface, Surface]], touch: Touch) -> Kind:
    """Decide how to check a pair with hulls that touch at home.

    Args:
        places: (k, 4, 4) of the second link in the first's frame, home first.
        levels: Both surfaces of the collision geometry, then both of the visual geometry.
    """
    checked = levels[0]
    if not all(len(surface.triangles) for surface in checked):
        return Kind.NO_SURFACE
    if len(places) >= SAMPLES and all(touch(*checked, place) for place in places):
        return Kind.ALWAYS
    for level, kind in zip(levels, (Kind.COLLISION_SURFACES, Kind.VISUAL_SURFACES), strict=True):
        if all(len(surface.triangles) for surface in level) and not touch(*level, places[0]):
            return kind
    return Kind.TOUCHING


def _apart_at_home(places: FloatArray, one: Surface, other: Surface, touch: Touch) -> Finding:
    """Decide how to check a pair that is apart at home.

    Visual surfaces do not count: the author of the collision geometry may have enlarged it on purpose.

    Args:
        places: (k, 4, 4) of the second link in the first's frame where their hulls touch.
    """
    triangles = len(one.triangles), len(other.triangles)
    if not all(triangles):
        return Finding(Kind.APART)
    if sum(triangles) > MOST_TRIANGLES:
        return Finding(Kind.TOO_LARGE, len(places) / SURVEYED)
    false = 0
    for place in places:
        if time.process_time() > _SURVEY_ENDS * TIME_LIMIT_S:
            return Finding(Kind.APART)
        if touch.surfaces_touch(one, other, place):
            continue
        if touch.is_inside(one, other, place):
            # A check of the surfaces would miss this contact.
            return Finding(Kind.APART)
        false += 1
    return Finding(Kind.FALSE_CONTACTS, false / SURVEYED) if false >= FEWEST_FALSE else Finding(Kind.APART)


def _key(case: Case) -> str:
    digest = hashlib.sha256(f"{_VERSION} {case.pairs} {case.placements.shape}".encode())
    # Rounded, because the last digit may differ between processors.
    for array in (*case.checked, *case.drawn, case.placements[:8], *case.touching):
        digest.update(f"{array.shape}".encode())
        digest.update((np.round(array, 9) + 0.0).tobytes())
    return digest.hexdigest()


def _encode_case(case: Case) -> bytes:
    arrays: dict[str, Any] = {"pairs": np.array(case.pairs), "placements": case.placements}
    for name, some in (("checked", case.checked), ("drawn", case.drawn), ("touching", case.touching)):
        arrays |= {f"{name}{number}": each for number, each in enumerate(some)}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _decode_case(data: bytes) -> Case:
    with np.load(io.BytesIO(data)) as arrays:
        count = arrays["placements"].shape[1]
        checked, drawn = (
            tuple(arrays[f"{name}{number}"] for number in range(count)) for name in ("checked", "drawn")
        )
        pairs = tuple((one, other) for one, other in arrays["pairs"].tolist())
        touching = tuple(arrays[f"touching{number}"] for number in range(len(pairs)))
        return Case(pairs, checked, drawn, arrays["placements"], touching)


def _encode_results(found: Sequence[Finding]) -> bytes:
    return json.dumps(found).encode()


def _cached_results(path: Path, case: Case) -> tuple[Finding, ...] | None:
    """Read the result of an earlier study; None if there is none or the file is damaged."""
    try:
        found = tuple(Finding(Kind(kind), float(share)) for kind, share in json.loads(path.read_bytes()))
    except (OSError, ValueError, TypeError):
        return None
    return found if len(found) == len(case.pairs) else None


def main() -> None:
    """Study the case on standard input and write the result file, unless another process just did."""
    path = Path(sys.argv[1])
    path.parent.mkdir(parents=True, exist_ok=True)
    os.nice(5)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    resource.setrlimit(resource.RLIMIT_CPU, (int(TIME_LIMIT_S), int(TIME_LIMIT_S)))
    # The services of a site start the same study at the same time.
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        case = _decode_case(sys.stdin.buffer.read())
        if _cached_results(path, case) is None:
            write_atomically(path, _encode_results(study(case)))


if __name__ == "__main__":
    main()
