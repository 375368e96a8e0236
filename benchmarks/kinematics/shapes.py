"""Time and memory for reading mesh files, compared with VTK's importers in the same run.

    ./dev run python -m benchmarks shapes [--runs 5] [--vtk-python PYTHON] [--large] [--json]

The program makes the files: a wavy plate of 50,000 triangles in each format (3DS holds it in five objects),
and with --large one of 1,000,000 as VRML, with its progress. Each reading is a separate process, and both
readers take turns. The time to import the libraries does not count for either.
"""

import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import Option

from benchmarks.harness.program import ROOT
from benchmarks.harness.turns import spread
from robots.shapes.files.read import read_geometry
from robots.shapes.files.three_ds.write import write_3ds
from robots.shapes.files.write_glb import glb_of
from robots.shapes.files.write_others import write_obj, write_ply, write_stl
from robots.shapes.geometry import Geometry, Material, Part
from robots.shapes.normals import creased

VTK = {
    ".wrl": "vtkVRMLImporter",
    ".3ds": "vtk3DSImporter",
    ".stl": "vtkSTLReader",
    ".obj": "vtkOBJReader",
    ".ply": "vtkPLYReader",
    ".glb": "vtkGLTFReader",
}


def measure(
    runs: int = 5,
    vtk_python: Annotated[str, Option(help="a Python that has vtk")] = sys.executable,
    large: Annotated[bool, Option("--large", help="also read 1,000,000 triangles of VRML")] = False,
) -> dict[str, Any]:
    """Return medians and spreads [s] of each format, and the memory for reading over the file's size."""
    with tempfile.TemporaryDirectory() as folder:
        return measure_in(Path(folder), runs, vtk_python, large=large)


def measure_in(folder: Path, runs: int, vtk_python: str, *, large: bool) -> dict[str, Any]:
    version = _vtk_version(vtk_python)
    sizes = [(ending, 50_000) for ending in WRITERS] + ([(".wrl", 1_000_000)] if large else [])
    rows = []
    for ending, count in sizes:
        path = folder / f"plate{count // 1000}k{ending}"
        path.write_bytes(WRITERS[ending](plate(count)))
        ours, theirs, memory = [], [], []
        for _ in range(runs if count < 1_000_000 else min(runs, 2)):
            found = _child(sys.executable, "ours", path)
            ours.append(found["seconds"])
            memory.append(found["bytes"])
            if version is not None:
                theirs.append(_child(vtk_python, "vtk", path)["seconds"])
        rows.append(
            {
                "file": path.name,
                "triangles": found["triangles"],
                "bytes": path.stat().st_size,
                "progress_calls": found["progress_calls"],
                "ours": spread(ours),
                "vtk": spread(theirs) if theirs else None,
                "ratio": statistics.median(ours) / statistics.median(theirs) if theirs else None,
                "memory_ratio": statistics.median(memory) / path.stat().st_size,
            }
        )
    return {"vtk": version, "runs": runs, "rows": rows}


def _vtk_version(python: str) -> str | None:
    code = "import vtkmodules.vtkCommonCore as c; print(c.vtkVersion().GetVTKVersion())"
    done = subprocess.run([python, "-c", code], capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else None


def _child(python: str, who: str, path: Path) -> dict[str, Any]:
    command = [python, "-m", __name__, str(path)]
    if who == "vtk":
        command = [python, "-c", _VTK_READING, VTK[path.suffix], str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    if done.returncode:
        raise SystemExit(f"{who} on {path.name}: {done.stderr.strip().splitlines()[-1:]}")
    answer: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return answer


def _reading(file: str) -> dict[str, Any]:
    path = Path(file)
    if path.suffix in (".stl", ".obj", ".ply", ".glb"):
        import trimesh  # noqa: F401
    calls: list[float] = []
    # Current, not peak, memory: memory that the imports used and freed must not hide the reader's use.
    before = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
    start = time.perf_counter()
    geometry = read_geometry(path, calls.append)
    seconds = time.perf_counter() - start
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before
    return {
        "seconds": seconds,
        "bytes": grown,
        "triangles": geometry.triangle_count,
        "progress_calls": len(calls),
    }


_VTK_READING = """
import json, sys, time
name, path = sys.argv[1:]
import vtkmodules.vtkIOImport, vtkmodules.vtkIOGeometry, vtkmodules.vtkIOPLY
import vtkmodules.vtkRenderingOpenGL2
modules = (vtkmodules.vtkIOImport, vtkmodules.vtkIOGeometry, vtkmodules.vtkIOPLY)
reader = next(getattr(module, name) for module in modules if hasattr(module, name))()
reader.SetFileName(path)
start = time.perf_counter()
reader.Update()
print(json.dumps({"seconds": time.perf_counter() - start}))
"""


def plate(count: int) -> Geometry:
    """Return a wavy plate of about that number of triangles."""
    side = round((count / 2) ** 0.5)
    x, y = np.meshgrid(np.arange(side + 1.0), np.arange(side + 1.0))
    vertices = np.column_stack([x.ravel(), y.ravel(), 5 * np.sin(x / 7).ravel() * np.cos(y / 9).ravel()])
    corner = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    triangles = np.concatenate(
        [
            np.column_stack([corner, corner + 1, corner + side + 2]),
            np.column_stack([corner, corner + side + 2, corner + side + 1]),
        ]
    )
    return Geometry(
        (Part("plate", Material("steel", (0.5, 0.6, 0.7)), *creased(vertices, triangles, np.pi)),)
    )


def _in_pieces(geometry: Geometry, pieces: int) -> Geometry:
    (part,) = geometry.parts
    parts = []
    for triangles in np.array_split(part.triangles, pieces):
        used, faces = np.unique(triangles, return_inverse=True)
        parts.append(
            Part(part.name, part.material, part.vertices[used], part.normals[used], faces.reshape(-1, 3))
        )
    return Geometry(tuple(parts))


def _vrml(geometry: Geometry) -> bytes:
    """Return VRML as CAD programs write it: points and faces, without normals."""
    (part,) = geometry.parts
    points = ",\n".join(f"{x:.6f} {y:.6f} {z:.6f}" for x, y, z in part.vertices.tolist())
    faces = ",\n".join(f"{a}, {b}, {c}, -1" for a, b, c in part.triangles.tolist())
    return (
        "#VRML V2.0 utf8\nShape { appearance Appearance { material Material { diffuseColor 0.5 0.6 0.7 } }\n"
        f"geometry IndexedFaceSet {{ coord Coordinate {{ point [\n{points} ] }}\n"
        f"coordIndex [\n{faces} ] }} }}\n"
    ).encode()


WRITERS: Mapping[str, Callable[[Geometry], bytes]] = {
    ".wrl": _vrml,
    ".3ds": lambda geometry: write_3ds(_in_pieces(geometry, 5)),
    ".stl": write_stl,
    ".obj": lambda geometry: write_obj(geometry, "none.mtl")[0].replace("mtllib none.mtl\n", "").encode(),
    ".ply": write_ply,
    ".glb": glb_of,
}


if __name__ == "__main__":  # a reading in a separate process
    print(json.dumps(_reading(sys.argv[1])))
