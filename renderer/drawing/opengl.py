"""Off-screen OpenGL contexts, shader programs, and shapes on the GPU."""

import ctypes
import logging
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from renderer.drawing import body_shaders, shaders
from renderer.errors import NoOpenGLError
from renderer.shapes.prepare import VERTEX, BufferGeometry

log = logging.getLogger(__name__)

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
# What Mesa calls its renderers that need no GPU.
_SOFTWARE = ("llvmpipe", "softpipe", "swrast")


def open_context(device: int | None = None) -> moderngl.Context:
    """Return an off-screen OpenGL context through EGL; it belongs to the thread that made it.

    Args:
        device: Number of the EGL device, on a machine with several; None: the first GPU that works, or
            software.

    Raises:
        NoOpenGLError: If there is no EGL or OpenGL library, or no such device.
    """
    _keep_freed_memory()
    try:
        return _open(_best_device() if device is None else device)
    except _CannotOpenError as error:
        devices = () if device is None else tuple(device_names())
        raise NoOpenGLError(str(error), device=device, devices=devices) from None


def device_names() -> list[str]:
    """Return what draws on each EGL device, by its number, or why it cannot be used."""
    names = []
    for number in range(_device_count()):
        try:
            context = _open(number)
        except _CannotOpenError as error:
            names.append(f"not usable ({error})")
        else:
            names.append(device_name(context))
            context.release()
    return names


def device_name(context: moderngl.Context) -> str:
    """Return the driver's name of the device that draws, and whether it draws in software."""
    name = str(context.info["GL_RENDERER"]) or "a device without a name"
    return f"{name}, in software" if _is_software(name) else name


def _is_software(name: str) -> bool:
    return name.startswith(_SOFTWARE)


class _CannotOpenError(Exception):
    """An EGL device without a usable OpenGL; the text is one line."""


def _open(device: int) -> moderngl.Context:
    options: dict[str, Any] = {"backend": "egl", "device_index": device}
    try:
        return moderngl.create_context(standalone=True, require=330, **options)
    except Exception as error:  # moderngl raises bare Exception, ImportError and OSError here.
        raise _CannotOpenError(" ".join(str(error).split()) or type(error).__name__) from None


@cache
def _best_device() -> int:
    """Return the number of the first GPU that works, or else of software, and log which do not work.

    A process can see a GPU that it may not use: in a container, or as a user without rights to its file.
    """
    count = _device_count()
    if count < 2:
        return 0
    working = {}
    for number in range(count):
        try:
            context = _open(number)
        except _CannotOpenError as error:
            log.warning("EGL device %d cannot be used: %s", number, error)
        else:
            working[number] = device_name(context)
            context.release()
    gpus = [number for number, name in working.items() if not _is_software(name)]
    return next(iter([*gpus, *working]), 0)


def _device_count() -> int:
    """Return the number of EGL devices; 0 also without EGL."""
    count = ctypes.c_int(0)
    try:
        egl = ctypes.CDLL("libEGL.so.1")
        egl.eglGetProcAddress.restype = ctypes.c_void_p
        address = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    except (OSError, AttributeError):
        return 0
    if address:
        query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(address)
        query(0, None, ctypes.byref(count))
    return count.value


def _keep_freed_memory() -> None:
    """Make glibc keep freed memory: software OpenGL frees its scene in each frame (16.7 -> 11.4 ms)."""
    try:
        libc = ctypes.CDLL(None)
        libc.mallopt(_M_MMAP_THRESHOLD, 32 << 20)
        libc.mallopt(_M_TRIM_THRESHOLD, 2_000_000_000)
    except (OSError, AttributeError):
        return  # another C library, without this problem


@dataclass(frozen=True, eq=False)
class Programs:
    """The compiled shaders."""

    body: moderngl.Program
    vertex_lit: moderngl.Program
    edge: moderngl.Program
    ribbon: moderngl.Program
    lamp: moderngl.Program
    cast: moderngl.Program
    backdrop: moderngl.Program
    plane: moderngl.Program
    shade: moderngl.Program
    compose: moderngl.Program


def compile_programs(context: moderngl.Context, *, samples: int, full: bool) -> Programs:
    """Compile the shaders for a number of samples per pixel; `full`: with the lamp's shadow on bodies."""
    body, compose = body_shaders.BODY_FRAGMENT, f"#define SAMPLES {samples}\n{shaders.COMPOSE_FRAGMENT}"
    if full:
        body = f"#define FULL\n{body}"
    return Programs(
        body=context.program(body_shaders.BODY_VERTEX, f"{shaders.VERSION}{body}"),
        vertex_lit=context.program(body_shaders.LIT_VERTEX, body_shaders.LIT_FRAGMENT),
        edge=context.program(body_shaders.EDGE_VERTEX, body_shaders.EDGE_FRAGMENT),
        ribbon=context.program(body_shaders.RIBBON_VERTEX, body_shaders.RIBBON_FRAGMENT),
        lamp=context.program(body_shaders.LAMP_VERTEX, body_shaders.LAMP_FRAGMENT),
        cast=context.program(shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT),
        backdrop=context.program(shaders.FULL_PICTURE_VERTEX, shaders.BACKDROP_FRAGMENT),
        plane=context.program(shaders.PLANE_VERTEX, shaders.PLANE_FRAGMENT),
        shade=context.program(shaders.PLANE_VERTEX, shaders.SHADE_FRAGMENT),
        compose=context.program(shaders.RECTANGLE_VERTEX, f"{shaders.VERSION}{compose}"),
    )


@dataclass(frozen=True, eq=False)
class Uploaded:
    """A shape on the GPU.

    Attributes:
        geometry: The source.
        corners: (8, 3) corners of the box around it, in the shape's frame [m].
        levels: First triangle and end of each level of detail.
        errors: Of each level [m].
    """

    geometry: BufferGeometry

    body: moderngl.VertexArray | None
    vertex_lit: moderngl.VertexArray | None
    edges: moderngl.VertexArray | None
    shadow: moderngl.VertexArray | None
    lamp: moderngl.VertexArray | None
    corners: NDArray[np.float64]
    levels: tuple[tuple[int, int], ...]
    errors: tuple[float, ...]
    _buffers: list[moderngl.Buffer] = field(default_factory=list)

    def release(self) -> None:
        """Release the GPU memory."""
        for array in (self.body, self.vertex_lit, self.edges, self.shadow, self.lamp):
            if array is not None:
                array.release()
        for buffer in self._buffers:
            buffer.release()


def upload(context: moderngl.Context, programs: Programs, geometry: BufferGeometry) -> Uploaded:
    """Upload a geometry to the GPU."""
    buffers: list[moderngl.Buffer] = []

    def buffer(data: bytes) -> moderngl.Buffer:
        buffers.append(context.buffer(data))
        return buffers[-1]

    vertices = np.zeros(len(geometry.positions), dtype=VERTEX)
    vertices["position"], vertices["normal"] = geometry.positions, geometry.normals
    vertices["color"], vertices["surface"] = geometry.colors, geometry.surface
    body = vertex_lit = edges = shadow = lamp = None
    if len(geometry.triangles):
        content = buffer(vertices.tobytes())
        layout = (content, "3f 3f 4f1 4f1", "position", "normal", "paint", "surface")
        indices = buffer(geometry.triangles.astype("u4").tobytes())
        body = context.vertex_array(programs.body, [layout], index_buffer=indices)
        vertex_lit = context.vertex_array(programs.vertex_lit, [layout], index_buffer=indices)
        lamp = context.vertex_array(programs.lamp, [(content, "3f 20x", "position")], index_buffer=indices)
    if len(geometry.edges):
        ends = buffer(geometry.edges.tobytes())
        edges = context.vertex_array(programs.edge, [(ends, "3f", "position")], mode=moderngl.LINES)
    if len(geometry.shadow):
        shadow = context.vertex_array(programs.cast, [(buffer(geometry.shadow.tobytes()), "3f", "position")])
    low, high = (
        (geometry.positions.min(axis=0), geometry.positions.max(axis=0)) if len(vertices) else (0.0, 0.0)
    )
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    box = low + corners * np.subtract(high, low)
    starts = geometry.levels.tolist()
    levels = tuple(pairwise(starts))
    return Uploaded(
        geometry, body, vertex_lit, edges, shadow, lamp, box, levels, tuple(geometry.errors.tolist()), buffers
    )


def columns(matrix: NDArray[np.float64]) -> bytes:
    """Return a matrix in OpenGL's format: float32, by columns."""
    return np.ascontiguousarray(matrix.T, dtype=np.float32).tobytes()


def set_uniforms(program: moderngl.Program, **values: bytes | float | tuple[float, ...]) -> None:
    """Set a program's uniforms; those that the compiler removed as unused are skipped."""
    for name, value in values.items():
        uniform = program.get(name, None)
        if isinstance(uniform, moderngl.Uniform):
            if isinstance(value, bytes):
                uniform.write(value)
            else:
                uniform.value = value
