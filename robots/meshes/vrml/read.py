"""VRML 2.0 files to meshes.

Source: ISO/IEC 14772-1:1997.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from robots.meshes.mesh import Mesh
from robots.meshes.vrml.drawing import Drawing
from robots.meshes.vrml.files import Files

# How much of the time goes into the text.
_READ = 0.7


def read_vrml(
    path: Path, progress: Callable[[float], None] | None = None, *, within: Path | None = None
) -> Mesh:
    """What a .wrl file draws, in its own units and axes; Inline files are read too.

    Joints of a robot stand at zero.

    Args:
        progress: Called now and then with how much is done, 0 to 1.
        within: Only files below this folder are read; others count as missing.

    Raises:
        MeshError: If it is not a VRML 2.0 file that can be read, with line and column.
    """
    told = progress if progress is not None else _nobody
    files = Files(within)
    path = path if within is None else path.resolve()
    scene = files.scene(path, lambda done: told(done * _READ))
    drawing, inside = Drawing(files), (path, path.resolve())
    # Each goes when it is drawn: a tree of many small nodes is larger than what it draws.
    ahead, count = scene.nodes[::-1], len(scene.nodes)
    scene.nodes.clear()
    while ahead:
        drawing.draw(ahead.pop(), np.eye(4), inside)
        told(1.0 - (1.0 - _READ) * len(ahead) / count)
    told(1.0)
    drawing.tell()
    return Mesh(
        tuple(drawing.parts),
        wires=tuple(drawing.wires),
        warnings=tuple(files.warnings()),
        missing=tuple(files.missing),
        files=tuple(files.asked),
    )


def _nobody(_: float) -> None:
    """Nobody asked how far it is."""
