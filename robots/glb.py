"""A robot's links as GLB: what goes over the network and into URDF.

Each link's mesh is brought into the link's frame, in metres and z upwards as the robot's own (not
turned to glTF's y), painted as the description says, and kept in the user's cache by the content
it was made from: with a warm cache trimesh, 1.5 s of import, is not needed.
"""

import hashlib
import importlib
import logging
import os
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robots.joints import FloatArray
from robots.meshes.mesh import PAINT, Color, Material, Mesh, Part, transformed
from robots.meshes.read import read_mesh
from robots.poses import pose_matrix
from robots.schema import Body, RobotDescription

logger = logging.getLogger(__name__)

# Part of each cache name: counts up when the same mesh file is to give another GLB.
_VERSION = 1
# How some materials reflect (metallic, roughness); mesh files of this age cannot say it.
_FINISHES = {"paint": (0.0, 0.45), "casting": (0.25, 0.6), "steel": (0.85, 0.3), "rubber": (0.0, 0.9)}


def link_meshes(description: RobotDescription, *, cache: Path | None = None) -> dict[str, bytes]:
    """GLB of each link that has a mesh, by link name, base first; in the link's frame, metres.

    Args:
        cache: Folder of finished GLB files; the user's cache folder unless given.

    Raises:
        MeshError: If a mesh file cannot be read.
    """
    folder = cache_folder() if cache is None else cache
    meshes = {}
    for name, body in description.bodies.items():
        path = description.mesh_path(body)
        if path is not None:
            meshes[name] = _cached_glb(description, body, path, folder)
    return meshes


def cache_folder() -> Path:
    """Where GLB files are kept: below XDG_CACHE_HOME or ~/.cache; a temporary folder if that is read-only."""
    home = os.environ.get("XDG_CACHE_HOME")
    roots = [Path(home)] if home else [Path.home() / ".cache"]
    for root in [*roots, Path(tempfile.gettempdir())]:
        folder = root / "robomesh" / "meshes"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        # In the temporary folder it may be another user's, who could put anything there.
        if os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid():
            return folder
    return Path(tempfile.mkdtemp(prefix="robomesh-meshes-"))


def _cached_glb(description: RobotDescription, body: Body, path: Path, folder: Path) -> bytes:
    placement = pose_matrix(body.mesh_pose, description.units)
    recipe = f"{_VERSION} {path.suffix.lower()} {body.mesh_scale!r} {body.color} {placement.tolist()!r} "
    content = path.read_bytes() if path.is_file() else b""
    cached = folder / (hashlib.sha256(recipe.encode() + content).hexdigest() + ".glb")
    if cached.is_file():
        return cached.read_bytes()
    mesh = read_mesh(path)
    glb = glb_of(link_mesh(mesh, body, placement))
    # What comes from other files too cannot be known by this file's content.
    if mesh.self_contained:
        _keep(cached, glb)
    return glb


def link_mesh(mesh: Mesh, body: Body, mesh_to_link: FloatArray) -> Mesh:
    """A mesh file's content in its link's frame [m] and in the description's colour."""
    scale = np.diag([body.mesh_scale, body.mesh_scale, body.mesh_scale, 1.0])
    parts = [transformed(part, mesh_to_link @ scale) for part in mesh.parts]
    if body.color is not None:
        names = {part.material.name for part in parts}
        color = rgb(body.color)
        parts = [
            replace(part, material=replace(part.material, diffuse=color))
            if PAINT not in names or part.material.name == PAINT
            else part
            for part in parts
        ]
    return replace(mesh, parts=tuple(parts))


def rgb(color: str) -> Color:
    """Red, green and blue, 0 to 1, of "#rrggbb"."""
    red, green, blue = (int(color[start : start + 2], 16) / 255 for start in (1, 3, 5))
    return red, green, blue


def glb_of(mesh: Mesh) -> bytes:
    """A mesh as binary glTF: one primitive a part, its axes as they are."""
    trimesh: Any = importlib.import_module("trimesh")  # 1.5 s; without types

    scene = trimesh.Scene()
    for number, part in enumerate(_merged(mesh)):
        material = part.material
        metallic, roughness = _FINISHES.get(material.name, (0.0, 0.55))
        scene.add_geometry(
            trimesh.Trimesh(
                vertices=part.vertices,
                faces=part.triangles,
                vertex_normals=part.normals,
                visual=trimesh.visual.TextureVisuals(
                    material=trimesh.visual.material.PBRMaterial(
                        name=material.name or f"material {number}",
                        baseColorFactor=[*_linear(material.diffuse), 1.0 - material.transparency],
                        emissiveFactor=_linear(material.emissive),
                        metallicFactor=metallic,
                        roughnessFactor=roughness,
                        alphaMode="BLEND" if material.transparency > 0 else "OPAQUE",
                        doubleSided=part.two_sided,
                    )
                ),
                process=False,
                validate=False,
            ),
            geom_name=f"{number} {part.name}".strip(),
        )
    return bytes(trimesh.exchange.gltf.export_glb(scene, include_normals=True))


def _merged(mesh: Mesh) -> list[Part]:
    """Parts of one material joined: fewer to draw."""
    groups: dict[tuple[Material, bool], list[Part]] = {}
    for part in mesh.parts:
        groups.setdefault((part.material, part.two_sided), []).append(part)
    merged = []
    for parts in groups.values():
        offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
        merged.append(
            replace(
                parts[0],
                vertices=np.concatenate([part.vertices for part in parts]),
                normals=np.concatenate([part.normals for part in parts]),
                triangles=np.concatenate(
                    [part.triangles + offset for part, offset in zip(parts, offsets, strict=False)]
                ),
            )
        )
    return merged


def _linear(color: Color) -> list[float]:
    """glTF's factors are linear light, the file's colours are sRGB."""
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in color]


def _keep(path: Path, content: bytes) -> None:
    """Write whole or not at all: another process may read it at any time."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(content)
        Path(file.name).replace(path)
    except OSError as error:
        logger.warning("mesh cache %s: %s; meshes are made again at each start", path.parent, error.strerror)
