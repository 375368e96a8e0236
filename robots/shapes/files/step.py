"""STEP and IGES reader: Open CASCADE (cascadio) triangulates; the axes and STEP's unit are kept.

    python -m robots.shapes.files.step IN OUT.glb MEMORY_LIMIT FORMAT    converts a file in its own process

Some damaged files make Open CASCADE run forever or allocate without bound, and it cannot be stopped
within this process. So it runs in another process, with limits.
"""

import re
import resource
import signal
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from robomesh.extras import is_missing, missing
from robots.schema.errors import ShapeError
from robots.shapes.files.declared_size import content
from robots.shapes.files.gltf import read_gltf
from robots.shapes.geometry import Geometry, transformed_geometry

# Largest distance of a triangle from the surface [mm], and largest angle between neighbours [rad].
_DEVIATION_MM = 0.1
_TURN = 0.35
TIME_LIMIT_S = 120.0
MEMORY_LIMIT = 6 << 30
# Memory is allocated in pieces of up to 64 MiB: a failure so near to the limit is taken for a lack of memory.
_NEAR, _PIECES = 0.9, 128 << 20
_OUT_OF_MEMORY = 77
# Without memory the C++ code aborts, or dereferences a null pointer.
_NO_MEMORY = re.compile(rb"MemoryError|bad_alloc|Cannot allocate memory|failed to map segment")
_ENDED_BY_MEMORY = {_OUT_OF_MEMORY, -signal.SIGABRT}
_PREFIXES = {"MILLI": 1e-3, "CENTI": 1e-2, "DECI": 1e-1, "MICRO": 1e-6, "$": 1.0, "KILO": 1e3}
_INCHES = {"INCH": 0.0254, "FOOT": 0.3048}
# Entity 314, a colour that the standard does not number, in the directory section of an IGES file.
_IGES_COLOR = re.compile(rb"^ {5}314 ", re.MULTILINE)
_NO_COLORS = "the colours of IGES are not read: export STEP to keep them"


def read_step(
    path: Path,
    *,
    kind: str = "step",
    time_limit_s: float = TIME_LIMIT_S,
    memory_limit: int = MEMORY_LIMIT,
) -> Geometry:
    """Return the triangles of a STEP or IGES file, in its axes, and in the unit of STEP or millimetres.

    Args:
        kind: "step", "stp", "iges" or "igs".
        memory_limit: Largest address space of the reading process [bytes].

    Raises:
        ShapeError: If it is not a readable file of that kind, or exceeds the time or memory limit.
    """
    form = "IGES" if kind in ("iges", "igs") else "STEP"
    if is_missing("cascadio"):
        raise ShapeError(path, missing("cascadio"))
    data = content(path)
    if form == "IGES":
        # Open CASCADE converts IGES to millimetres, and STEP to metres.
        made_m = unit_m = 1e-3
        warnings: tuple[str, ...] = (_NO_COLORS,) if _IGES_COLOR.search(data) else ()
    elif b"ISO-10303-21" in data[:1024]:
        made_m, (unit_m, warnings) = 1.0, _unit(data)
    else:
        raise ShapeError(path, "is not a STEP file: one begins with ISO-10303-21")
    with tempfile.TemporaryDirectory() as folder:
        glb = Path(folder) / "made.glb"
        arguments = (str(path), str(glb), str(memory_limit), form.lower())
        try:
            done = subprocess.run(
                [sys.executable, "-P", "-m", "robots.shapes.files.step", *arguments],
                capture_output=True,
                timeout=time_limit_s,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise ShapeError(
                path, f"took Open CASCADE more than {time_limit_s:.0f} s; it may be damaged"
            ) from error
        if done.returncode in _ENDED_BY_MEMORY or _NO_MEMORY.search(done.stderr):
            raise ShapeError(path, f"needs more than {memory_limit / 1024**3:g} GB of memory to read")
        if done.returncode == -signal.SIGSEGV:
            # Open CASCADE does not check whether an allocation failed.
            raise ShapeError(
                path,
                f"crashed Open CASCADE: it needs more than {memory_limit / 1024**3:g} GB of memory to read, "
                "or is damaged",
            )
        if done.returncode or not glb.is_file():
            raise ShapeError(path, f"cannot be read as {form}: {_reason(done.stdout + done.stderr, form)}")
        geometry = read_gltf(glb)
    if not geometry.triangle_count:
        raise ShapeError(path, "has no solid or surface that can be drawn")
    geometry = transformed_geometry(geometry, np.diag([made_m / unit_m] * 3 + [1.0]))
    return replace(geometry, warnings=(*geometry.warnings, *warnings), unit_m=unit_m, up="z")


def _unit(data: bytes) -> tuple[float, tuple[str, ...]]:
    """Return the file's unit of length [m], and warnings; Open CASCADE itself converts to metres."""
    text = re.sub(r"\s", "", data.decode("latin-1")).upper()
    named = {
        _PREFIXES.get(name.strip("."), 1e-3) for name in re.findall(r"SI_UNIT\(([.A-Z$]+),\.METRE\.\)", text)
    }
    inches = {_INCHES[name] for name in re.findall(r"CONVERSION_BASED_UNIT\('(INCH|FOOT)'", text)}
    found = inches or named
    if len(found) == 1:
        return found.pop(), ()
    return 1e-3, ("does not state exactly one unit of length; its numbers are given in millimetres",)


def _reason(output: bytes, form: str) -> str:
    text = re.sub(r"\x1b\[[0-9;]*m", "", output.decode("utf-8", errors="replace"))
    places = re.findall(r"Line (\d+): *([^*\n]+)", text)
    if places:
        line, reason = places[0]
        return f"line {line}: {reason.strip()}"
    return f"Open CASCADE found no {form} model"


def main() -> None:
    """Convert one file; exit with status 1 if that failed, 77 if memory was short."""
    source, made, memory_limit, iges = *map(Path, sys.argv[1:3]), int(sys.argv[3]), sys.argv[4] == "iges"
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (memory_limit, most))
    # The parent enforces the time limit, but it may have exited.
    resource.setrlimit(resource.RLIMIT_CPU, (int(TIME_LIMIT_S), int(TIME_LIMIT_S)))
    try:
        import cascadio

        glb = cascadio.load(
            source.read_bytes(),
            "iges" if iges else "step",
            tol_linear=_DEVIATION_MM,
            tol_angular=_TURN,
            use_parallel=False,
            # A STEP file's faces may have colours of their own.
            merge_primitives=iges,
        )
    except Exception:
        # Python's own modules fail too, with errors of many kinds.
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
        if _has_memory(memory_limit):
            raise
        sys.exit(_OUT_OF_MEMORY)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    if not glb:
        sys.exit(1 if _has_memory(memory_limit) else _OUT_OF_MEMORY)
    made.write_bytes(glb)


def _has_memory(limit: int) -> bool:
    """Return whether peak memory stayed well below the limit; Open CASCADE does not report why it failed."""
    most = int(Path("/proc/self/status").read_text().split("VmPeak:")[1].split()[0]) * 1024
    return most < min(_NEAR * limit, limit - _PIECES)


if __name__ == "__main__":
    main()
