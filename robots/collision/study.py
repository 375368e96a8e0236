"""Pairs of an arm's links whose hulls touch at home: which may be ignored, and which are checked in parts.

    python -m robots.collision.study KEPT.npz < CASE.npz      in a process of its own, with limits

A pair that touches in all sampled positions, as exact meshes too, is ignored. One whose meshes are apart at
home is checked as convex parts of its meshes. What is found is kept in the user's cache by its content.
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
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from robots.collision.sampling import SAMPLES
from robots.collision.surfaces import Part, Surface, Touch, parted, relative
from robots.glb import cache_folder
from robots.joints import FloatArray

log = logging.getLogger(__name__)

# Part of each name in the cache: counts up when the same case is to give another result.
_VERSION = 1
TIME_LIMIT_S = 120.0
_MEMORY_LIMIT = 4 << 30
# Positions in which parts are tried, and at most so many in which they are cut further.
_TRIED, _CUT_AT = 400, 40


class Kind(StrEnum):
    """What becomes of a pair: it touches in every position, is checked in parts, or as its hulls."""

    ALWAYS = "always"
    PARTS = "parts"
    HULLS = "hulls"


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


@dataclass(frozen=True, eq=False)
class Found:
    """What was found of a pair.

    Attributes:
        parts: Of both links, for each part its triangles' corners (n, 3) in the link's frame [m].
        text: In words.
    """

    kind: Kind
    text: str
    parts: tuple[tuple[FloatArray, ...], tuple[FloatArray, ...]] = ((), ())


def studied(case: Case, *, wait: bool = True) -> tuple[Found, ...] | None:
    """What is found of each pair of a case, from the cache where it was studied before.

    Args:
        wait: Else a study that takes time goes on in its own process, and None is returned until it ends.
    """
    path = cache_folder().parent / "collision" / f"{_key(case)}.npz"
    with contextlib.suppress(OSError, ValueError, KeyError):
        return _loaded(path.read_bytes())
    running = _running.get(path)
    if running is None:
        running = _running[path] = _Study(case, path)
    if not wait and not running.ended:
        return None
    found = running.result()
    del _running[path]
    return found


class _Study:
    """A process that studies a case, and ends when it takes too long."""

    def __init__(self, case: Case, path: Path) -> None:
        self._case, self._path = case, path
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

    def result(self) -> tuple[Found, ...]:
        try:
            self._process.wait(max(self._until_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        with contextlib.suppress(OSError, ValueError, KeyError):
            return _loaded(self._path.read_bytes())
        text = (
            f"a study of them took over {TIME_LIMIT_S:.0f} s or {_MEMORY_LIMIT >> 30} GB: hulls are checked"
        )
        log.warning("two links that touch at home: %s", text)
        found = tuple(Found(Kind.HULLS, text) for _ in self._case.pairs)
        _keep(self._path, _saved(found))
        return found


_running: dict[Path, _Study] = {}


def study(case: Case) -> tuple[Found, ...]:
    """Study each pair of a case."""
    touch = Touch()
    checked, drawn = ([Surface(each) for each in some] for some in (case.checked, case.drawn))
    return tuple(
        _pair(case, pair, [(some[pair[0]], some[pair[1]]) for some in (checked, drawn)], touch)
        for pair in case.pairs
    )


def _pair(
    case: Case, pair: tuple[int, int], levels: Sequence[tuple[Surface, Surface]], touch: Touch
) -> Found:
    one, other = (case.placements[:, number] for number in pair)
    places = relative(one, other)
    first = levels[0]
    if not all(len(surface.whole.triangles) for surface in first):
        return Found(Kind.HULLS, "they touch at home; one has no surface, so hulls are checked")
    enough = len(places) >= SAMPLES
    if enough and all(touch(*_exact(first), place) for place in places):
        return Found(Kind.ALWAYS, f"they touch in all of {len(places):,} positions, as exact meshes too")
    for level, geometry in zip(levels, ("collision", "visual"), strict=True):
        if not all(len(surface.whole.triangles) for surface in level) or touch(*_exact(level), places[0]):
            continue
        hulls = [surface.whole.body.geometry for surface in level]
        free = [
            place
            for place in places[1:_TRIED]
            if touch(hulls[0], hulls[1], place) and not touch(*_exact(level), place)
        ]
        sides = parted(*level, [places[0], *free[:_CUT_AT]], touch)
        if sides is not None:
            counts = " and ".join(str(len(side)) for side in sides)
            text = f"checked as {counts} convex parts of their {geometry} geometry"
            return Found(Kind.PARTS, text, (_corners(sides[0]), _corners(sides[1])))
    return Found(Kind.HULLS, "they touch at home, as exact meshes too, but not in all positions")


def _exact(level: tuple[Surface, Surface]) -> tuple[Any, Any]:
    return level[0].exact, level[1].exact


def _corners(parts: Sequence[Part]) -> tuple[FloatArray, ...]:
    return tuple(np.unique(part.triangles.reshape(-1, 3), axis=0) for part in parts)


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
    return _npz(arrays)


def _given(data: bytes) -> Case:
    with np.load(io.BytesIO(data)) as arrays:
        count = arrays["placements"].shape[1]
        checked, drawn = (
            tuple(arrays[f"{name}{number}"] for number in range(count)) for name in ("checked", "drawn")
        )
        pairs = tuple((one, other) for one, other in arrays["pairs"].tolist())
        return Case(pairs, checked, drawn, arrays["placements"])


def _saved(found: Sequence[Found]) -> bytes:
    arrays: dict[str, Any] = {}
    rows = []
    for number, each in enumerate(found):
        rows.append([each.kind, each.text, [len(side) for side in each.parts]])
        for side, parts in enumerate(each.parts):
            arrays |= {f"{number}/{side}/{part}": points for part, points in enumerate(parts)}
    arrays["found"] = np.array(json.dumps(rows))
    return _npz(arrays)


def _loaded(data: bytes) -> tuple[Found, ...]:
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        rows = json.loads(str(arrays["found"]))
        return tuple(
            Found(
                Kind(kind),
                text,
                (
                    tuple(arrays[f"{number}/0/{part}"] for part in range(counts[0])),
                    tuple(arrays[f"{number}/1/{part}"] for part in range(counts[1])),
                ),
            )
            for number, (kind, text, counts) in enumerate(rows)
        )


def _npz(arrays: Mapping[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


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
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_LIMIT, _MEMORY_LIMIT))
    resource.setrlimit(resource.RLIMIT_CPU, (int(TIME_LIMIT_S), int(TIME_LIMIT_S)))
    # The services of a site ask for the same study at the same time.
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.is_file():
            _keep(path, _saved(study(_given(sys.stdin.buffer.read()))))


if __name__ == "__main__":
    main()
