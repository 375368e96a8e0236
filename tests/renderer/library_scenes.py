"""Library robots and cells with their published descriptions, ready to draw."""

from functools import cache
from pathlib import Path

import numpy as np

from renderer.drawing.drawing import Drawing
from renderer.drawing.opengl import open_context
from renderer.scene.appearance import Appearance, appearance_of, shape_name
from renderer.shapes.cache import prepared_once
from renderer.shapes.prepare import BufferGeometry
from robots.descriptions.cells import CellDescription, CellRobot
from robots.descriptions.description import load
from robots.descriptions.glb import link_glbs
from robots.descriptions.urdf.write import to_urdf
from services.cells.descriptions import cells_of
from services.kinematics.descriptions import add_surroundings, describe, fixture_shapes
from services.site_file import site as site_file


@cache
def robot(name: str, folder: Path) -> tuple[Appearance, dict[str, BufferGeometry]]:
    """Return a single library robot and its shapes; `folder` is the cache."""
    return _robot(name, CellRobot(name=name, model=name, base_to_site=np.eye(4)), None, folder)


@cache
def cell(path: Path, folder: Path) -> tuple[dict[str, Appearance], dict[str, BufferGeometry]]:
    """Return the robots of a site file with one cell, by name, and the shapes of all."""
    appearances, shapes = {}, {}
    for name, description in cells_of(site_file.load(path)).items():
        own = next(each for each in description.robots if each.name == name)
        appearances[name], more = _robot(str(own.model), own, description, folder)
        shapes |= more
    return appearances, shapes


def drawing_of(shapes: dict[str, BufferGeometry], size: tuple[int, int], **options) -> Drawing:
    """Return a drawing with shapes added."""
    drawing = Drawing(open_context(), size, **options)
    for name, mesh in shapes.items():
        drawing.add(name, mesh)
    return drawing


def posed(appearance: Appearance, off: float = 0.35) -> dict[str, float]:
    """Return joint positions near home, each with a different offset."""
    joints = appearance.description.joints
    return {joint.name: joint.home + off * np.sin(number + 1) for number, joint in enumerate(joints)}


def _robot(
    model: str, own: CellRobot, around: CellDescription | None, folder: Path
) -> tuple[Appearance, dict[str, BufferGeometry]]:
    description = load(model)
    glbs = link_glbs(description)
    message = describe(
        description,
        urdf=to_urdf(description),
        shapes=glbs,
        base_to_site=own.base_to_site,
        cell="",
        simulated=True,
    )
    bodies = [(link, glbs[link.mesh]) for link in message.links if link.mesh]
    if around is not None:
        fixtures = fixture_shapes(around)
        add_surroundings(message, own, around, fixtures)
        bodies += zip(message.fixtures, (each.glb for each in fixtures), strict=True)
    shapes = {shape_name(body): prepared_once(glb, color=body.color, folder=folder) for body, glb in bodies}
    return appearance_of(message), shapes
