"""Reader of VRML 2.0 files.

Source: ISO/IEC 14772-1:1997.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from robots.shapes.files.vrml.drawing import Drawing
from robots.shapes.files.vrml.files import Files
from robots.shapes.geometry import Geometry

# Share of the time that parsing takes.
_READ = 0.7


def read_vrml(
    path: Path, progress: Callable[[float], None] | None = None, *, within: Path | None = None
) -> Geometry:
    """Return the content of a .wrl file, in the file's units and axes; Inline files are read too.

    A robot's joints are at zero.

    Args:
        progress: Called with the completed fraction, 0 to 1.
        within: Only files below this folder are read; files elsewhere count as missing.

    Raises:
        ShapeError: If it is not a readable VRML 2.0 file; the error has the line and column.
    """
    report = progress if progress is not None else _ignore_progress
    files = Files(within)
    path = path if within is None else path.resolve()
    scene = files.scene(path, lambda done: report(done * _READ))
    drawing, inside = Drawing(files), (path, path.resolve())
    # Each node is freed once drawn: a tree of many small nodes takes more memory than its triangles.
    pending, count = scene.nodes[::-1], len(scene.nodes)
    scene.nodes.clear()
    while pending:
        drawing.draw(pending.pop(), np.eye(4), inside)
        report(1.0 - (1.0 - _READ) * len(pending) / count)
    report(1.0)
    drawing.warn_of_skipped()
    return Geometry(
        tuple(drawing.parts),
        wires=tuple(drawing.wires),
        warnings=tuple(files.warnings()),
        missing=tuple(files.missing),
        files=tuple(files.looked_up),
    )


def _ignore_progress(_: float) -> None:
    """Ignore a progress report."""
