"""Shared fixtures of the tests of robots."""

from collections.abc import Callable
from pathlib import Path

import pytest

from robots.shapes.files.vrml.read import read_vrml
from robots.shapes.geometry import Geometry


@pytest.fixture
def draw(tmp_path: Path) -> Callable[[str], Geometry]:
    """Return the drawing of a VRML text, with the header before it, from a file `a.wrl`."""

    def drawn(text: str) -> Geometry:
        path = tmp_path / "a.wrl"
        path.write_text(f"#VRML V2.0 utf8\n{text}")
        return read_vrml(path)

    return drawn
