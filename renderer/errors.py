"""Errors of the renderer.

RendererError
├── NoOpenGLError           no OpenGL here: the text names what to install
├── NoEncoderError          no H.264 encoder could be opened, or one failed
├── GlbError                bytes that are not the GLB that a mesh should be
├── ChainError              a URDF that is not a serial chain
├── Mp4Error                packets that cannot be put into an MP4 file
├── ViewRequestError        a view of one's own that is not possible
│   └── NoRoomError         as it is possible, but too much is drawn already
├── CameraError             a camera that hangs on nothing, or looks nowhere
└── UnknownViewError        a view that neither the description nor the renderer has
"""

from collections.abc import Iterable


class RendererError(Exception):
    """Base of the renderer's errors; its text is one line for people."""


class NoOpenGLError(RendererError):
    """OpenGL cannot be used on this machine."""

    def __init__(self, reason: str, *, device: int | None = None) -> None:
        text = (
            f"no OpenGL here ({reason}): install it with 'apt-get install libegl1 libgl1'; "
            "everything but the renderer runs without it"
        )
        if device is not None:
            text = (
                f"EGL device {device} cannot be used ({reason}): name another (they count from 0), or none "
                "for EGL's own choice; libegl1 and libgl1 must be installed"
            )
        super().__init__(text)


class NoEncoderError(RendererError):
    """No H.264 encoder could be opened, or one failed."""


class GlbError(RendererError):
    """A mesh that is not GLB, or of a kind that is not drawn."""


class ChainError(RendererError):
    """A URDF that is not a serial chain."""


class Mp4Error(RendererError):
    """Packets that cannot be put into an MP4 file."""


class ViewRequestError(RendererError):
    """A view of one's own that is not possible."""


class NoRoomError(ViewRequestError):
    """A requested view that exceeds what the renderer can draw now."""


class CameraError(RendererError):
    """A camera that hangs on nothing, looks nowhere, or has numbers that are not possible."""


class UnknownViewError(RendererError):
    """A view that there is none of."""

    def __init__(self, view: str, known: Iterable[str]) -> None:
        super().__init__(f"no view {view!r}; there are {', '.join(sorted(known))}")
        self.view = view
