"""Time for one picture: drawing, reading it back, overlay, H.264 and JPEG, for each size and anti-aliasing.

    ./dev run python -m benchmarks drawing [--robot pt600] [--device N] [--triangles 20k|100k] [--pictures 60]
        [--json]

Runs on software OpenGL and on a GPU, and prints the device and the encoder. "draw" includes the time to read
the picture back; "read" is that time alone, of a finished picture.
"""

import time
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
from typer import Option

from benchmarks.renderer.renderer import geometry_of
from renderer.drawing.drawing import Drawing
from renderer.drawing.opengl import open_context
from renderer.encoding.encoder import jpeg, open_encoder
from renderer.errors import RendererError
from renderer.pictures.overlay import Overlay, Row, write_over
from renderer.scene.cameras import Camera, fitted
from renderer.scene.scene import Part, Scene
from robots.descriptions.description import load
from robots.descriptions.glb import link_glbs
from robots.kinematics.model import build_model, link_placements

SIZES = ((640, 360), (854, 480), (1280, 720), (1920, 1080))


def measure(
    robot: str = "pt600",
    device: Annotated[int | None, Option(help="number of the EGL device")] = None,
    triangles: Literal["20k", "100k"] = "20k",
    pictures: int = 60,
) -> dict[str, Any]:
    """Return the medians [ms] of each step for each size and anti-aliasing."""
    description = load(robot)
    model = build_model(description)
    shapes = {name: geometry_of(glb, triangles) for name, glb in link_glbs(description).items()}
    rows = []
    for size, samples in product(SIZES, (0, 4)):
        try:
            drawing = Drawing(open_context(device), size, samples=samples)
        except RendererError as error:
            raise SystemExit(str(error)) from None
        for name, geometry in shapes.items():
            drawing.add(name, geometry)
        encoder = open_encoder(size, 30)
        times, reads, sizes = [], [], []
        for number in range(pictures):
            positions = model.joints.home + 0.3 * np.sin(number / 15)
            placements = dict(zip(model.link_names, link_placements(model, positions), strict=True))
            scene, camera = view(shapes, placements, size)
            marks = [time.perf_counter()]
            picture = drawing.draw(scene, camera)
            marks.append(time.perf_counter())
            write_over(picture, overlay(positions))
            marks.append(time.perf_counter())
            sizes.append(len(encoder.encode(picture, key_frame=number == 0).data))
            marks.append(time.perf_counter())
            jpeg(picture)
            marks.append(time.perf_counter())
            times.append(np.diff(marks) * 1e3)
            reads.append(read_back_ms(drawing))
        table = np.array(times)
        draw, write, h264, still = np.median(table, axis=0).tolist()
        total = table[:, :3].sum(axis=1)
        rows.append(
            {
                "size": size,
                "samples": samples,
                "draw": draw,
                "draw_p10": float(np.percentile(table[:, 0], 10)),
                "draw_p90": float(np.percentile(table[:, 0], 90)),
                "read": float(np.median(reads)),
                "overlay": write,
                "h264": h264,
                "jpeg": still,
                "all": float(np.median(total)),
                "all_p90": float(np.percentile(total, 90)),
                "kilobytes": float(np.mean(sizes)) / 1e3,
            }
        )
        name = drawing.renderer_name
        drawing.close()
    count = sum(len(geometry.triangles) for geometry in shapes.values())
    return {
        "robot": robot,
        "triangles": count,
        "device": name,
        "encoder": encoder.name,
        "rows": rows,
    }


def read_back_ms(drawing: Drawing) -> float:
    with drawing.context:
        drawing.context.finish()
        began = time.perf_counter()
        drawing._final.read_into(drawing._pixels, components=4)
        return (time.perf_counter() - began) * 1e3


def view(shapes, placements, size):
    points = np.array([[x, y, z] for x in (-0.4, 0.4) for y in (-0.4, 0.4) for z in (0.0, 1.0)])
    center = np.array([0.0, 0.0, 0.45])
    camera = Camera(center + np.array([1.5, -1.5, 0.85]), center, np.array([0.0, 0.0, 1.0]))
    parts = tuple(Part(name, placements[name]) for name in shapes)
    return Scene(parts, center, 0.9), fitted(camera, size[0] / size[1], points)


def overlay(positions):
    rows = tuple(Row(f"joint {n}", f"{np.degrees(q):.2f}", "°", 0.5) for n, q in enumerate(positions))
    return Overlay(title="robot", view="free", time=f"{positions[0]:.3f}", state="moving", rows=rows)
