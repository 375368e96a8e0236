"""Meshes of a recording's bodies."""

from renderer.shapes.cache import cache_folder, stored_glb
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.reading import RecordingFile
from robomesh.schemas import robomesh_pb2 as schema
from services.export.errors import ExportError


def recorded_shape(file: RecordingFile, body: schema.Description.Link | schema.Description.Fixture) -> bytes:
    """Return a body's GLB from the recording, or from this machine's cache.

    Raises:
        ExportError: If neither has it.
    """
    try:
        glb: bytes | None = file.attachment(f"mesh/{body.mesh}")
    except RecordingError:
        glb = stored_glb(body.mesh_sha256, cache_folder())
    if glb is None:
        raise ExportError(
            f"{file.path.name}: it holds no mesh of {body.name}, and none is in the cache of this machine"
        )
    return glb
