"""Errors of the renderer.

RendererError
├── NoOpenGLError           no OpenGL here: the text names what to install
├── NoEncoderError          no H.264 encoder could be opened, or one failed
├── GlbError                bytes that are not the GLB that a mesh should be
├── ChainError              a URDF that is not a serial chain
└── UnknownViewError        a view that neither the description nor the renderer has
"""

from collections.abc import Iterable


class RendererError(Exception):
    """Base of the renderer's errors; its text is one line for people."""


class NoOpenGLError(RendererError):
    """OpenGL cannot be used on this machine."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"no OpenGL here ({reason}): install it with 'apt-get install libegl1 libgl1'; "
            "everything but the renderer runs without it"
        )


class NoEncoderError(RendererError):
    """No H.264 encoder could be opened, or one failed."""


class GlbError(RendererError):
    """A mesh that is not GLB, or of a kind that is not drawn."""


class ChainError(RendererError):
    """A URDF that is not a serial chain."""


class UnknownViewError(RendererError):
    """A view that there is none of."""

    def __init__(self, view: str, known: Iterable[str]) -> None:
        super().__init__(f"no view {view!r}; there are {', '.join(sorted(known))}")
        self.view = view
