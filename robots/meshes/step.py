"""STEP files to meshes, triangulated by Open CASCADE (cascadio), in the file's own unit, as it stands.

    python -m robots.meshes.step IN.step OUT.glb      one file, in a process of its own

Some broken files make Open CASCADE run without end or without bound; nothing in this process could
stop it. So it runs in another, with limits.
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

from robots.errors import MeshError
from robots.meshes.declared_size import content
from robots.meshes.mesh import Mesh, transformed_mesh
from robots.meshes.trimesh_formats import read_trimesh

# How far a triangle may lie off the surface [mm], and neighbours turn [rad]: what a drawing of a link shows.
_DEVIATION_MM = 0.1
_TURN = 0.35
TIME_LIMIT_S = 120.0
MEMORY_LIMIT = 6 << 30
# It asks for memory in pieces: a failure so near to the limit is for want of it.
_NEAR = 0.9
_OUT_OF_MEMORY = 77
# Without memory C++ aborts, or reads where there is none.
_NO_MEMORY = re.compile(rb"MemoryError|bad_alloc|Cannot allocate memory|failed to map segment")
_ENDED_BY_MEMORY = {_OUT_OF_MEMORY, -signal.SIGABRT}
_PREFIXES = {"MILLI": 1e-3, "CENTI": 1e-2, "DECI": 1e-1, "MICRO": 1e-6, "$": 1.0, "KILO": 1e3}
_INCHES = {"INCH": 0.0254, "FOOT": 0.3048}


def read_step(path: Path, *, time_limit_s: float = TIME_LIMIT_S, memory_limit: int = MEMORY_LIMIT) -> Mesh:
    """The triangles of a .step or .stp file, in its own unit and axes.

    Args:
        memory_limit: Most bytes of address space that reading may take.

    Raises:
        MeshError: If it is not a STEP file that can be read, or takes more time or memory than the limits.
    """
    data = content(path)
    if b"ISO-10303-21" not in data[:1024]:
        raise MeshError(path, "is no STEP file: it begins with ISO-10303-21")
    unit_m, warnings = _unit(data)
    with tempfile.TemporaryDirectory() as folder:
        glb = Path(folder) / "made.glb"
        try:
            done = subprocess.run(
                [sys.executable, "-P", "-m", "robots.meshes.step", str(path), str(glb), str(memory_limit)],
                capture_output=True,
                timeout=time_limit_s,
                check=False,
            )
        except subprocess.TimeoutExpired as error:
            raise MeshError(path, f"took Open CASCADE over {time_limit_s:.0f} s; it may be broken") from error
        if done.returncode in _ENDED_BY_MEMORY or _NO_MEMORY.search(done.stderr):
            raise MeshError(path, f"needs more than {memory_limit / 1024**3:g} GB of memory to read")
        if done.returncode == -signal.SIGSEGV:
            # It does not look whether it was given the memory that it asked for.
            raise MeshError(
                path,
                f"ended Open CASCADE: it needs more than {memory_limit / 1024**3:g} GB of memory to read, "
                "or is damaged",
            )
        if done.returncode or not glb.is_file():
            raise MeshError(path, f"is no STEP that can be read: {_said(done.stdout + done.stderr)}")
        mesh = read_trimesh(glb)
    if not mesh.triangle_count:
        raise MeshError(path, "holds no solid or surface that can be drawn")
    mesh = transformed_mesh(mesh, np.diag([1 / unit_m] * 3 + [1.0]))
    return replace(mesh, warnings=(*mesh.warnings, *warnings), unit_m=unit_m, up="z")


def _unit(data: bytes) -> tuple[float, tuple[str, ...]]:
    """The file's unit of length [m]; Open CASCADE gives metres."""
    text = re.sub(r"\s", "", data.decode("latin-1")).upper()
    named = {
        _PREFIXES.get(name.strip("."), 1e-3) for name in re.findall(r"SI_UNIT\(([.A-Z$]+),\.METRE\.\)", text)
    }
    inches = {_INCHES[name] for name in re.findall(r"CONVERSION_BASED_UNIT\('(INCH|FOOT)'", text)}
    found = inches or named
    if len(found) == 1:
        return found.pop(), ()
    return 1e-3, ("states no one unit of length; its numbers are given in millimetres",)


def _said(output: bytes) -> str:
    text = re.sub(r"\x1b\[[0-9;]*m", "", output.decode("utf-8", errors="replace"))
    places = re.findall(r"Line (\d+): *([^*\n]+)", text)
    if places:
        line, reason = places[0]
        return f"line {line}: {reason.strip()}"
    return "Open CASCADE finds no STEP model in it"


def main() -> None:
    """Convert one file; exit status 1 when nothing came of it."""
    source, made, memory_limit = sys.argv[1], sys.argv[2], int(sys.argv[3])
    resource.setrlimit(resource.RLIMIT_AS, (memory_limit, memory_limit))
    # Whoever started it may be gone by then.
    resource.setrlimit(resource.RLIMIT_CPU, (int(TIME_LIMIT_S), int(TIME_LIMIT_S)))
    import cascadio

    try:
        status = cascadio.step_to_glb(
            source,
            made,
            tol_linear=_DEVIATION_MM,
            tol_angular=_TURN,
            use_parallel=False,
            merge_primitives=False,
        )
    except MemoryError:
        sys.exit(_OUT_OF_MEMORY)
    if status and not _has_memory(memory_limit):
        status = _OUT_OF_MEMORY
    sys.exit(status if status in (0, _OUT_OF_MEMORY) else 1)


def _has_memory(limit: int) -> bool:
    """Return whether Open CASCADE, which says only that it failed, came nowhere near the limit."""
    most = int(Path("/proc/self/status").read_text().split("VmPeak:")[1].split()[0]) * 1024
    return most < _NEAR * limit


if __name__ == "__main__":
    main()
