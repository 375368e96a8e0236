"""Generator of the tests' reference pictures, and of the pictures in the documents.

./dev run python tests/renderer/make_pictures.py            # tests/renderer/pictures/
./dev run python tests/renderer/make_pictures.py --docs     # docs/rendered-*.png
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])

from renderer.pictures.overlay import Overlay, Row, _write_badge, write_over
from renderer.scene.appearance import frame_placements, placements_at
from renderer.scene.assembly import Placed, scene_of
from renderer.scene.cameras import fitted
from renderer.scene.views import camera_from, camera_of
from renderer.shapes.cache import cache_folder
from robomesh.schemas.robomesh_pb2 import Vector3, View
from tests.renderer.library_scenes import cell, drawing_of, posed, robot

ROOT = Path(__file__).parents[2]
PICTURES = Path(__file__).with_name("pictures")
CELL = ROOT / "examples" / "cell.toml"
SMALL, DOCS = (320, 180), (800, 450)

Picture = np.ndarray


def free(folder, *, shading="fast", size=SMALL, near=False, change=lambda scene: scene):
    """Draw a Puma 560 from the front right."""
    appearance, shapes = robot("puma560", folder)
    scene = change(scene_of(Placed(appearance, placements_at(appearance, posed(appearance)))))
    return _drawn(shapes, scene, camera_of(appearance, "free"), size, shading, near=near)


def front(folder, *, size=SMALL):
    """Draw a Pt600 from the front with an orthographic camera."""
    appearance, shapes = robot("pt600", folder)
    scene = scene_of(Placed(appearance, placements_at(appearance, posed(appearance))))
    return _drawn(shapes, scene, camera_of(appearance, "front"), size, "fast")


def full(folder, *, size=SMALL):
    """Draw a cell with the lamp's shadow on all bodies; the right arm is stale."""
    return _cell(folder, size, shading="full")


def program(folder, *, size=SMALL):
    """Draw a checked program's ghost and path, the tool's trail and axes, and a link in contact."""
    appearances, _ = cell(CELL, folder)
    appearance = appearances["left"]
    now = posed(appearance)
    reached = {**now, "waist": now["waist"] - 0.9}

    def tool_at(positions):
        return frame_placements(appearance, placements_at(appearance, positions))["tool"][:3, 3]

    steps = np.linspace(0.0, 1.0, 40)
    swing = [{**now, "waist": now["waist"] + 0.8 * s, "elbow": now["elbow"] + 0.3 * s} for s in steps[::-1]]
    return _cell(
        folder,
        size,
        view=View(eye=Vector3(x=2.1, y=-1.7, z=1.1), target=Vector3(x=0.1, y=-0.05, z=0.42)),
        touching={"wrist"},
        trail=np.array([tool_at(each) for each in swing]),
        frames=True,
        ghost=placements_at(appearance, reached),
        path=np.array([tool_at({**now, "waist": now["waist"] - 0.9 * s}) for s in steps]),
    )


def fence(folder, *, size=SMALL):
    """Draw a cell from behind the fence, which is transparent."""
    view = View(eye=Vector3(x=-2.7, y=-1.7, z=1.3), target=Vector3(x=0.1, y=-0.4, z=0.4))
    return _cell(folder, size, view=view)


STORED: dict[str, Callable[..., Picture]] = {
    "free": free,
    "front": front,
    "full": full,
    "program": program,
    "fence": fence,
}


def _cell(folder, size, *, shading="fast", touching=(), view=None, **shown):
    appearances, shapes = cell(CELL, folder)
    left, right = appearances["left"], appearances["right"]
    placed = placements_at(left, posed(left))
    scene = scene_of(
        Placed(left, placed, touching=touching),
        Placed(right, placements_at(right, posed(right, -0.3)), stale=shading == "full"),
        **shown,
    )
    if view is None:
        view = View(eye=Vector3(x=2.6, y=-2.6, z=1.5), target=Vector3(x=0.0, y=-0.35, z=0.35))
    view.field_of_view = 0.55
    camera = camera_from(left, view, placed, aspect=size[0] / size[1])
    return _drawn(shapes, scene, camera, size, shading)


def _drawn(shapes, scene, camera, size, shading, *, near=False):
    drawing = drawing_of(shapes, size, shading=shading)
    if near:
        camera = fitted(camera, size[0] / size[1], drawing.corners(scene), margin=1.3)
    try:
        return drawing.draw(scene, camera)
    finally:
        drawing.close()


def legend(picture: Picture, view: str, marks: tuple[str, ...] = ("simulated",)) -> Picture:
    """Write the texts of a renderer's picture."""
    appearance, _ = robot("pt600", cache_folder())
    rows = tuple(
        Row(
            joint.name,
            f"{np.degrees(q):.2f}".replace("-", "−"),
            "°",
            (q - joint.lower) / (joint.upper - joint.lower),
        )
        for joint, q in zip(appearance.description.joints, posed(appearance).values(), strict=True)
    )
    scale = f"{appearance.square_m * 1e3:g} mm"
    write_over(
        picture,
        Overlay("left", view, "14:02:11.3 CST", "moving, auto", rows, marks=marks, scale=scale),
    )
    return picture


def stale() -> Picture:
    """Return the picture that a console's MJPEG shows while it receives no pictures."""
    picture = np.full((360, 640, 3), 120, dtype=np.uint8)
    for y, text, size in ((62, "STALE", 72), (216, "no picture comes", 44)):
        _write_badge(picture, text, size=size, y=y)
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", action="store_true")
    arguments = parser.parse_args()
    folder = cache_folder()
    if not arguments.docs:
        PICTURES.mkdir(exist_ok=True)
        for name, make in STORED.items():
            write(PICTURES / f"{name}.png", make(folder))
        return
    write(ROOT / "services" / "console" / "http" / "stale.jpg", stale())
    write(ROOT / "docs" / "rendered-arm.png", free(folder, size=DOCS, shading="full", near=True))
    write(ROOT / "docs" / "rendered-cell.png", legend(program(folder, size=DOCS), "free"))


def write(path: Path, picture: Picture) -> None:
    jpeg = path.suffix == ".jpg"
    options = [cv2.IMWRITE_JPEG_QUALITY, 80] if jpeg else [cv2.IMWRITE_PNG_COMPRESSION, 9]
    cv2.imwrite(str(path), picture[..., ::-1], options)


if __name__ == "__main__":
    main()
