"""Pictures a second, compared with VTK, pyrender and mujoco: same meshes, cameras and sizes.

    ./dev run python -m benchmarks renderer [--peers-python PYTHON] [--rounds 3] [--turns 12]
        [--device N] [--only 720p/4x/100k/1,...] [--json]

In software OpenGL, or on the EGL device with the number N. PYTHON is a separate environment with vtk,
pyrender and mujoco; a peer that it cannot import or run is reported and left out. pyrender pins PyOpenGL
3.1.0, with which MuJoCo fails: install 'pyopengl>=3.1.7' after both. --only selects rows by size, samples,
triangles and views. Each program is a separate process, which draws and reads back to NumPy; they take turns,
row by row, so that other load affects all of them. Ours draws more than the task for the peers: the floor and
its grid, the arm's soft shadow, edges, dimmed hollows; its rows "full" add the lamp's shadow on the arm.
20k is the arm's file, 100k a file with each of its triangles divided into four. "ours" is what the service
draws of it: levels of detail, and light at vertices where that is enough. The peers and "ours, whole" draw
every triangle. "differs" compares "ours" with pictures of every triangle and light at each pixel: the
largest difference of 255 levels, the shares of pixels that differ by more than 8 and 20, and PSNR.
Medians of all turns; the spread is from p10 to p90. On a machine with other load, pictures for a second of
one core's time are a better measure than pictures a second.
"""

import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from typer import BadParameter, Option

from benchmarks.harness.program import ROOT, chosen, say
from benchmarks.renderer.renderer_peers import drawn, reason
from renderer.drawing.drawing import Drawing
from renderer.drawing.opengl import open_context
from renderer.scene.cameras import Camera
from renderer.scene.scene import Part, Scene
from renderer.shapes.prepare import MOST_TRIANGLES, BufferGeometry, prepared_surfaces
from robots.descriptions.description import load
from robots.descriptions.glb import link_glbs
from robots.kinematics.model import build_model, link_placements
from robots.shapes.files.gltf import Surface, read_glb

ROBOT = "pt600"
SIZES = {"480p": (854, 480), "720p": (1280, 720)}
FIELD_OF_VIEW = float(np.deg2rad(24.0))
TARGET = np.array([0.0, 0.0, 0.45])
EYES = TARGET + np.array([[1.9, -1.9, 0.9], [2.6, 0.6, 0.8], [-1.8, -2.0, 1.1], [0.2, -2.7, 0.6]])
PEERS = ("vtk", "pyrender", "mujoco")
SOFTWARE = {"LIBGL_ALWAYS_SOFTWARE": "1", "EGL_PLATFORM": "surfaceless"}
# In which the peers look for the number of the device.
DEVICE_VARIABLES = ("MUJOCO_EGL_DEVICE_ID", "EGL_DEVICE_ID")


def measure(
    peers_python: Annotated[str, Option(help="a Python that has the peers")] = "",
    rounds: int = 3,
    turns: int = 12,
    device: Annotated[int | None, Option(help="number of the EGL device; none: software")] = None,
    only: Annotated[str, Option(help="rows, as 720p/4x/100k/1")] = "",
) -> dict[str, Any]:
    """Return the milliseconds of each row and program, and why a program is missing."""
    names = chosen("--only", only, [*map(name_of, rows())])
    if peers_python and not shutil.which(peers_python):
        raise BadParameter(f"--peers-python {peers_python}: no such program")
    wanted = [row for row in rows() if not names or name_of(row) in names]
    return measure_rows(peers_python, rounds, turns, device, wanted)


def rows() -> list[dict[str, Any]]:
    """Return every row: sizes, anti-aliasing and triangles, then views."""
    some = [
        {"size": size, "samples": samples, "count": count, "views": 1}
        for count in ("20k", "100k")
        for size in SIZES.values()
        for samples in (0, 4)
    ]
    more = [{"size": SIZES["720p"], "samples": 4, "count": "20k", "views": views} for views in (2, 4)]
    return some + more


def name_of(row: dict[str, Any]) -> str:
    """Return a row's name, as in 720p/4x/100k/1."""
    return f"{row['size'][1]}p/{row['samples']}x/{row['count']}/{row['views']}"


def measure_rows(
    peers_python: str, rounds: int, turns: int, device: int | None, wanted: list[dict[str, Any]]
) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.npz"
        triangles = write_scene(scene)
        own = [sys.executable, "-m", __name__, str(scene), *([] if device is None else [str(device)])]
        commands = {"ours": own, "ours, whole": own, "ours, full": own}
        if peers_python:
            peers = Path(__file__).with_name("renderer_peers.py")
            commands |= {peer: [peers_python, str(peers), peer, str(scene)] for peer in PEERS}
        servers = {name: Server(command, device) for name, command in commands.items()}
        try:
            versions = {name: server.answer() for name, server in servers.items()}
            here_now = {name: server for name, server in servers.items() if "ready" in versions[name]}
            answers: dict[tuple[int, str], list[dict[str, Any]]] = {}
            for _ in range(rounds):
                for number, row in enumerate(wanted):
                    for name, server in [*here_now.items()]:
                        answer = server.ask({**row, "turns": turns, "variant": name.partition(", ")[2]})
                        if "missing" in answer:
                            versions[name] = answer
                            del here_now[name]
                        answers.setdefault((number, name), []).append(answer)
                    say(f"row {number + 1} of {len(wanted)}")
            differs = [servers["ours"].ask({**row, "compare": True}) for row in wanted]
        finally:
            for server in servers.values():
                server.close()
    return {
        "robot": ROBOT,
        "triangles": triangles,
        "programs": {name: version["ready"] for name, version in versions.items() if "ready" in version},
        "missing": {name: version["missing"] for name, version in versions.items() if "missing" in version},
        "rows": [
            {
                **row,
                **{name: summary(answers[number, name], row["views"]) for name in here_now},
                "differs": differs[number],
            }
            for number, row in enumerate(wanted)
        ],
    }


def summary(answers: list[dict[str, Any]], views: int) -> dict[str, float]:
    """Return for one row and program: pictures a second, also of processor time, ms of a turn, memory."""
    ms = np.concatenate([answer["ms"] for answer in answers])
    low, middle, high = np.percentile(ms, [10, 50, 90]).tolist()
    cpu_ms = float(np.median(np.concatenate([answer["cpu_ms"] for answer in answers])))
    return {
        "pictures_per_core_s": 1e3 * views / cpu_ms,
        "cpu_ms": cpu_ms,
        "pictures_per_s": 1e3 * views / middle,
        "ms": middle,
        "ms_p10": low,
        "ms_p90": high,
        "drawn": answers[0]["drawn"],
        "device": answers[0]["device"],
        "rss_mib": max(answer["rss_mib"] for answer in answers),
    }


def write_scene(path: Path) -> dict[str, int]:
    """Write the arm's meshes with few and with many triangles, its motion, the cameras."""
    description = load(ROBOT)
    model = build_model(description)
    glbs = link_glbs(description)
    arrays: dict[str, Any] = {
        "links": len(glbs),
        "eyes": EYES,
        "target": TARGET,
        "field_of_view": FIELD_OF_VIEW,
    }
    totals = {}
    for count in ("20k", "100k"):
        shapes = [geometry_of(glb, count, whole=True) for glb in glbs.values()]
        totals[count] = sum(len(geometry.finest) for geometry in shapes)
        for number, geometry in enumerate(shapes):
            used = geometry.finest.max() + 1  # those of other levels of detail follow
            arrays[f"{count}/{number}/positions"] = geometry.positions[:used]
            arrays[f"{count}/{number}/normals"] = geometry.normals[:used]
            arrays[f"{count}/{number}/triangles"] = geometry.finest
            arrays[f"{count}/{number}/color"] = geometry.colors[:, :3].mean(axis=0) / 255.0
    arrays["placements"] = np.array(
        [
            [
                placement
                for name, placement in zip(
                    model.link_names,
                    link_placements(model, model.joints.home + 0.4 * np.sin(turn / 6)),
                    strict=True,
                )
                if name in glbs
            ]
            for turn in range(40)
        ]
    )
    np.savez(path, **arrays)
    return totals


@cache
def geometry_of(glb: bytes, count: str, *, whole: bool = False, exact: bool = False) -> BufferGeometry:
    """Return a mesh as the service draws it, or with every triangle, also with light at each pixel."""
    surfaces = read_glb(glb)
    if count == "100k":
        surfaces = tuple(map(subdivided, surfaces))
    geometry = prepared_surfaces(surfaces, most_triangles=10**9 if whole else MOST_TRIANGLES)
    if not whole:
        return geometry
    vertex_lit = geometry.vertex_lit[:1] * (0 if exact else 1)
    return replace(geometry, levels=geometry.levels[:2], errors=geometry.errors[:1], vertex_lit=vertex_lit)


def subdivided(surface: Surface) -> Surface:
    """Divide each triangle into four."""
    faces = surface.indices
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    unique, numbers = np.unique(np.sort(sides, axis=1), axis=0, return_inverse=True)
    ab, bc, ca = numbers.reshape(3, -1) + len(surface.vertices)
    a, b, c = faces.T
    pieces = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]

    def halved(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, values[unique].mean(axis=1)])

    normals = None if surface.normals is None else halved(surface.normals)
    if normals is not None:
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return replace(
        surface,
        vertices=halved(surface.vertices),
        normals=normals,
        colors=None if surface.colors is None else halved(surface.colors),
        indices=np.concatenate([np.stack(piece, axis=1) for piece in pieces]),
    )


def serve_ours(path: Path, device: int | None) -> None:
    """Answer rows as the peers do, and compare pictures."""
    scene = dict(np.load(path))
    glbs = link_glbs(load(ROBOT))
    print(json.dumps({"ready": "robomesh"}), flush=True)

    def make(row: dict[str, Any]) -> Any:
        whole, exact = (row["variant"] in names for names in (("whole", "exact"), ("exact",)))
        shading = "full" if row["variant"] == "full" else "fast"
        drawing = Drawing(open_context(device), tuple(row["size"]), samples=row["samples"], shading=shading)
        for name, glb in glbs.items():
            drawing.add(name, geometry_of(glb, row["count"], whole=whole, exact=exact))
        cameras = [
            Camera(eye, TARGET, np.array([0.0, 0.0, 1.0]), field_of_view=FIELD_OF_VIEW) for eye in EYES
        ]

        def render(placements: np.ndarray, view: int) -> np.ndarray:
            parts = tuple(Part(name, placement) for name, placement in zip(glbs, placements, strict=True))
            return drawing.draw(Scene(parts, TARGET, 0.95), cameras[view])

        return render, drawing.close, drawing.renderer_name

    for line in sys.stdin:
        row = json.loads(line)
        try:
            answer = compared(make, scene, row) if row.get("compare") else drawn(make, scene, row)
        except Exception as error:
            answer = {"missing": reason(error)}
        print(json.dumps(answer), flush=True)


def compared(make: Any, scene: dict[str, Any], row: dict[str, Any]) -> dict[str, float]:
    """Return how pictures of the service differ from those with every triangle and light at each pixel."""
    pictures = []
    for variant in ("", "exact"):
        render, close, _ = make({**row, "variant": variant})
        pictures.append(
            [render(scene["placements"][turn], view) for turn in (0, 10, 20) for view in range(len(EYES))]
        )
        close()
    levels = np.abs(np.subtract(*np.array(pictures, dtype=np.int16))).astype(np.float64)
    most = levels.max(axis=3)
    return {
        "most_levels": float(most.max()),
        "share_over_8": float((most > 8).mean()),
        "share_over_20": float((most > 20).mean()),
        "psnr_db": float(10.0 * np.log10(255.0**2 / max(float(np.square(levels).mean()), 1e-9))),
    }


class Server:
    """A process that answers each line with a line; its answer has "missing" if it cannot."""

    def __init__(self, command: list[str], device: int | None) -> None:
        chosen = SOFTWARE if device is None else {variable: str(device) for variable in DEVICE_VARIABLES}
        environment = os.environ | chosen
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment, cwd=ROOT
        )

    def ask(self, row: dict[str, Any]) -> dict[str, Any]:
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it has ended: `answer` reports it
            self._process.stdin.write(json.dumps(row) + "\n")
            self._process.stdin.flush()
        return self.answer()

    def answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            if line.startswith("{"):
                answer: dict[str, Any] = json.loads(line)
                return answer
        return {"missing": f"ended with status {self._process.wait()}"}

    def close(self) -> None:
        self._process.kill()
        with contextlib.suppress(BrokenPipeError):
            self._process.communicate()


if __name__ == "__main__":  # the process that draws ours
    serve_ours(Path(sys.argv[1]), int(sys.argv[2]) if sys.argv[2:] else None)
