"""Small GLB bodies for the renderer's tests."""

import json
import struct

import numpy as np
import pytest

from renderer.drawing.opengl import open_context
from renderer.errors import NoOpenGLError

_FACES = np.array([[0, 2, 6, 4], [1, 5, 7, 3], [0, 4, 5, 1], [2, 3, 7, 6], [0, 1, 3, 2], [4, 6, 7, 5]])


def cube(half, *, color=None, node=None):
    """Return the GLB of a cube centred on the origin; `color` is linear, as in glTF."""
    corners = np.array([[x, y, z] for x in (-half, half) for y in (-half, half) for z in (-half, half)])
    triangles = np.concatenate([_FACES[:, [0, 1, 2]], _FACES[:, [0, 2, 3]]])
    return glb(corners, triangles, color=color, node=node)


def ball(radius, *, rings=24, sectors=48, color=None):
    """Return the GLB of a sphere centred on the origin, without normals."""
    points = [
        (
            radius * np.sin(np.pi * ring / rings) * np.cos(2 * np.pi * sector / sectors),
            radius * np.sin(np.pi * ring / rings) * np.sin(2 * np.pi * sector / sectors),
            radius * np.cos(np.pi * ring / rings),
        )
        for ring in range(rings + 1)
        for sector in range(sectors)
    ]
    triangles = []
    for ring in range(rings):
        for sector in range(sectors):
            a, b = ring * sectors + sector, ring * sectors + (sector + 1) % sectors
            triangles += [(a, a + sectors, b), (b, a + sectors, b + sectors)]
    return glb(np.array(points), np.array(triangles), color=color)


def glb(positions, triangles, *, color=None, node=None):
    """Return a GLB with one primitive."""
    points = positions.astype("<f4").tobytes()
    indices = triangles.astype("<u4").tobytes()
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **(node or {})}],
        "meshes": [{"primitives": [primitive]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5125, "count": triangles.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(points)},
            {"buffer": 0, "byteOffset": len(points), "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": len(points) + len(indices)}],
    }
    if color is not None:
        primitive["material"] = 0
        document["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": list(color)}}]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = points + indices
    body = (
        struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x4E4942) + binary
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def context_or_skip():
    """Return an OpenGL context; skip the test with the reason if there is none."""
    try:
        return open_context()
    except NoOpenGLError as error:
        pytest.skip(str(error))
