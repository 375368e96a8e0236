"""Pairs of an arm's links whose hulls touch at home or often: which may be ignored, which checked as meshes.

    python -m robots.collision.pair_study KEPT.json < CASE.npz      in a process of its own, with limits

A pair that touches in all sampled positions, as exact meshes too, is ignored. A pair is checked as meshes if
only its hulls touch at home, or if it is apart there and only its hulls touch in at least 1 % of positions.
What is found is kept in the user's cache by its content; a failure is not.
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

from robomesh.atomic_write import write_atomically
from robots.collision.sampling import SAMPLES
from robots.collision.surfaces import Surface, Touch
from robots.collision.verdicts import Kind
from robots.glb import cache_folder
from robots.joints import FloatArray
from robots.meshes.mesh import IndexArray

log = logging.getLogger(__name__)

# Part of each name in the cache: counts up when the same case is to give another result.
_VERSION = 4
TIME_LIMIT_S = 120.0
MEMORY_LIMIT = 4 << 30
# Positions in which hulls are tried, and the fewest in which they must touch without their meshes: 1 %.
SURVEYED, FEWEST_FALSE = 400, 4
# After this share of the time, pairs that are apart at home stay hulls: a study over its limit loses all.
_SURVEY_ENDS = 0.75
# Two meshes with more triangles together would make each check too slow.
MOST_TRIANGLES = 50_000
# A study that failed is tried again after so long [s], then after twice that, and so on.
_AGAIN_S, _LATEST_AGAIN_S = 30.0, 3600.0
# After so many failures also a caller that does not wait gets hulls.
_TRIES = 4


@dataclass(frozen=True, eq=False)
class Case:
    """What a study is made of.

    Attributes:
        pairs: Numbers of two links each.
        checked, drawn: Of each link the triangles (n, 3, 3) of its geometry in its frame [m]; what is drawn
            only of links that touch another at home.
        placements: (samples, links, 4, 4) of the links, home first.
        touching: Of each pair that is apart at home, (k,) numbers of the placements in which its hulls touch;
            empty for a pair whose hulls touch at home.
    """

    pairs: tuple[tuple[int, int], ...]
    checked: tuple[FloatArray, ...]
    drawn: tuple[FloatArray, ...]
    placements: FloatArray
    touching: tuple[IndexArray, ...]


class Found(NamedTuple):
    """What a study found of a pair: its kind, and the share of positions that the kind's text names."""

    kind: Kind
    share: float = 0.0


def studied(case: Case, *, wait: bool = True) -> tuple[Found, ...] | None:
    """What is found of each pair of a case, from the cache where it was studied before.

    Args:
        wait: Else a study that takes time goes on in its own process, and None is returned until it has found
            something. One that failed is tried again later: until then waiting gives hulls.
    """
    path = cache_folder().parent / "collision" / f"{_key(case)}.json"
    with _lock:
        found = _kept(path, case)
        if found is not None:
            return found
        failures, again_s = _failed.get(path, (0, 0.0))
        running = _running.get(path)
        if running is None and time.monotonic() >= again_s:
            running = _running[path] = _Study(case, path)
    if running is not None:
        if not wait and not running.ended:
            return None
        running.join()
        with _lock:
            found = _kept(path, case)
            # Several threads may wait for one study: the first of them counts its failure.
            if _running.get(path) is running:
                del _running[path]
                _count(path, failed=found is None)
            failures, _ = _failed.get(path, (0, 0.0))
        if found is not None:
            return found
    if not wait and failures < _TRIES:
        return None
    # A pair that is apart at home is checked as hulls anyway.
    return tuple(Found(Kind.APART if len(each) else Kind.NOT_STUDIED) for each in case.touching)


def _count(path: Path, *, failed: bool) -> None:
    if not failed:
        _failed.pop(path, None)
        return
    failures, _ = _failed.get(path, (0, 0.0))
    pause_s = min(_AGAIN_S * 2**failures, _LATEST_AGAIN_S)
    _failed[path] = failures + 1, time.monotonic() + pause_s
    log.warning("the study of links whose hulls touch failed; it is tried again in %.0f s", pause_s)


class _Study:
    """A process that studies a case, and ends when it takes too long."""

    def __init__(self, case: Case, path: Path) -> None:
        with tempfile.TemporaryFile() as given:
            given.write(_stored(case))
            given.seek(0)
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "robots.collision.pair_study", str(path)],
                stdin=given,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )

        # Its processor time is limited inside; a process that waits or swaps is ended here.
        self._until_s = time.monotonic() + 3 * TIME_LIMIT_S

    @property
    def ended(self) -> bool:
        return self._process.poll() is not None or time.monotonic() > self._until_s

    def join(self) -> None:
        """Wait until the process has ended; end it when its time is over."""
        try:
            self._process.wait(max(self._until_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


# Held for both dictionaries, not while a study is waited for.
_lock = threading.Lock()
_running: dict[Path, _Study] = {}
# How many times a study failed, and when it is tried again.
_failed: dict[Path, tuple[int, float]] = {}


def study(case: Case) -> tuple[Found, ...]:
    """Study each pair of a case, those whose hulls touch at home first."""
    touch = Touch()
    checked, drawn = ([Surface(each) for each in some] for some in (case.checked, case.drawn))
    found: dict[int, Found] = {}
    for number in sorted(range(len(case.pairs)), key=lambda number: len(case.touching[number]) > 0):
        one, other = case.pairs[number]
        touching = case.touching[number]
        placements = case.placements[touching] if len(touching) else case.placements[:SAMPLES]
        places = np.linalg.solve(placements[:, one], placements[:, other]).astype(np.float64, copy=False)
        if len(touching):
            found[number] = _apart_at_home(places, checked[one], checked[other], touch)
        else:
            levels = [(some[one], some[other]) for some in (checked, drawn)]
            found[number] = Found(_touching_at_home(places, levels, touch))
    return tuple(found[number] for number in range(len(case.pairs)))


def _touching_at_home(places: FloatArray, levels: Sequence[tuple[Surface, Surface]], touch: Touch) -> Kind:
    """Decide how to check a pair whose hulls touch at home.

    Args:
        places: (k, 4, 4) of the second in the first's frame, home first.
        levels: Both surfaces of the collision geometry, then of the visual one.
    """
    checked = levels[0]
    if not all(len(surface.triangles) for surface in checked):
        return Kind.NO_SURFACE
    if len(places) >= SAMPLES and all(touch(*checked, place) for place in places):
        return Kind.ALWAYS
    for level, kind in zip(levels, (Kind.COLLISION_MESHES, Kind.VISUAL_MESHES), strict=True):
        if all(len(surface.triangles) for surface in level) and not touch(*level, places[0]):
            return kind
    return Kind.TOUCHING


def _apart_at_home(places: FloatArray, one: Surface, other: Surface, touch: Touch) -> Found:
    """Decide how to check a pair that is apart at home.

    Visual meshes do not count: if the collision geometry touches, its author may have widened it on purpose.

    Args:
        places: (k, 4, 4) of the second in the first's frame where their hulls touch.
    """
    triangles = len(one.triangles), len(other.triangles)
    if not all(triangles):
        return Found(Kind.APART)
    if sum(triangles) > MOST_TRIANGLES:
        return Found(Kind.TOO_LARGE, len(places) / SURVEYED)
    false = 0
    for place in places:
        if time.process_time() > _SURVEY_ENDS * TIME_LIMIT_S:
            return Found(Kind.APART)
        if touch.surfaces(one, other, place):
            continue
        if touch.inside(one, other, place):
            # A check of surfaces would miss it.
            return Found(Kind.APART)
        false += 1
    return Found(Kind.FALSE_CONTACTS, false / SURVEYED) if false >= FEWEST_FALSE else Found(Kind.APART)


def _key(case: Case) -> str:
    digest = hashlib.sha256(f"{_VERSION} {case.pairs} {case.placements.shape}".encode())
    # Rounded: another processor's last digit is no other robot.
    for array in (*case.checked, *case.drawn, case.placements[:8], *case.touching):
        digest.update(f"{array.shape}".encode())
        digest.update((np.round(array, 9) + 0.0).tobytes())
    return digest.hexdigest()


def _stored(case: Case) -> bytes:
    arrays: dict[str, Any] = {"pairs": np.array(case.pairs), "placements": case.placements}
    for name, some in (("checked", case.checked), ("drawn", case.drawn), ("touching", case.touching)):
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
        touching = tuple(arrays[f"touching{number}"] for number in range(len(pairs)))
        return Case(pairs, checked, drawn, arrays["placements"], touching)


def _saved(found: Sequence[Found]) -> bytes:
    return json.dumps(found).encode()


def _kept(path: Path, case: Case) -> tuple[Found, ...] | None:
    """What was found of each pair before; None: nothing, or the file is damaged."""
    try:
        found = tuple(Found(Kind(kind), float(share)) for kind, share in json.loads(path.read_bytes()))
    except (OSError, ValueError, TypeError):
        return None
    return found if len(found) == len(case.pairs) else None


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
        case = _given(sys.stdin.buffer.read())
        if _kept(path, case) is None:
            write_atomically(path, _saved(study(case)))


if __name__ == "__main__":
    main()
