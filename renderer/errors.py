"""Errors of the renderer.

RendererError
├── NoOpenGLError           OpenGL cannot be used: the text names what to install
├── NoEncoderError          no H.264 encoder could be opened, or one failed
├── GlbError                a shape is not valid GLB
├── ChainError              a URDF is not a tree of joints
├── Mp4Error                packets cannot be put into an MP4 file
├── PictureError            a picture cannot be written
└── ViewError               a view that cannot be drawn, with the reason
    ├── ViewRequestError    a requested view is not possible
    │   └── NoRoomError     a requested view exceeds what can be drawn now
    ├── CameraError         a camera has no mount, no direction, or invalid numbers
    └── UnknownViewError    neither the description nor the renderer has the view
"""

from collections.abc import Iterable, Sequence

from robomesh import reason_codes as codes
from robomesh.reasons import Reason


class RendererError(Exception):
    """Base of the renderer's errors; the text is one line for the operator."""


class NoOpenGLError(RendererError):
    """OpenGL cannot be used on this machine."""

    def __init__(self, reason: str, *, device: int | None = None, devices: Sequence[str] = ()) -> None:
        text = (
            f"OpenGL is not available ({reason}): install it with 'apt-get install libegl1 libgl1'; "
            "all other services run without it"
        )
        if device is not None:
            known = "; ".join(f"{number}: {name}" for number, name in enumerate(devices))
            text = (
                f"EGL device {device} cannot be used ({reason}): choose another, or none for the first "
                f"GPU that works; there is {known or 'none: libegl1 and libgl1 must be installed'}"
            )
        super().__init__(text)


class NoEncoderError(RendererError):
    """No H.264 encoder could be opened, or one failed."""


class GlbError(RendererError):
    """A shape is not GLB, or of an unsupported kind."""


class ChainError(RendererError):
    """A URDF is not a tree of joints."""


class Mp4Error(RendererError):
    """Packets cannot be put into an MP4 file."""


class PictureError(RendererError):
    """A picture cannot be written."""


class ViewError(RendererError):
    """A view that cannot be drawn; `reason` says why."""

    def __init__(self, reason: Reason) -> None:
        super().__init__(reason)
        self.reason = reason


class ViewRequestError(ViewError):
    """A requested view is not possible."""


class NoRoomError(ViewRequestError):
    """A requested view exceeds what the renderer can draw now."""


class CameraError(ViewError):
    """A camera has no mount, no direction, or invalid numbers."""


class UnknownViewError(ViewError):
    """The robot has no view of that name."""

    def __init__(self, view: str, known: Iterable[str]) -> None:
        super().__init__(codes.VIEW_UNKNOWN(view=view, views=", ".join(sorted(known))))
        self.view = view
