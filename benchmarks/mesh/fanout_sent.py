"""The payloads that `fanout` sends, and the keys of its secured connections."""

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

PICTURES = 60


def prepared(folder: Path) -> tuple[Path, Path]:
    """Prepare payloads without and with keys; our renderer draws the pictures."""
    import trustme
    from cryptography.hazmat.primitives import serialization

    plain, secured = folder / "plain", folder / "secured"
    plain.mkdir()
    secured.mkdir()
    for each in (plain, secured):
        (each / "joints").write_bytes(joints())
    video = b"".join(struct.pack("<I", len(each)) + each for each in pictures())
    for each in (plain, secured):
        (each / "video").write_bytes(video)
    authority = trustme.CA()
    issued = authority.issue_cert("127.0.0.1", "localhost", common_name="bench")
    key = serialization.load_pem_private_key(issued.private_key_pem.bytes(), None)
    (secured / "ca").write_bytes(authority.cert_pem.bytes())
    (secured / "tls").write_bytes(b"".join(part.bytes() for part in issued.cert_chain_pems))
    (secured / "key").write_bytes(
        key.private_bytes(
            serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
        )
    )
    # The key pair of CurveZMQ's own documentation.
    (secured / "curve").write_bytes(
        b"Yne@$w-vo<fVvi]a<NY6T1ed:M$fCG*[IaLV{hID\nD:)Q[IlAW!ahhC2ac:9*A}h:p?([4%wOTJ%JR%cs"
    )
    return plain, secured


def joints() -> bytes:
    from foxglove_schemas_protobuf.JointStates_pb2 import JointStates

    message = JointStates()
    message.timestamp.GetCurrentTime()
    for number in range(5):
        message.joints.add(name=f"joint-{number}", position=0.1 * number, velocity=0.01)
    return message.SerializeToString()


def pictures() -> Iterator[bytes]:
    """Return two seconds of a moving arm in 720p H.264, as messages."""
    from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

    from benchmarks.renderer.drawing import view
    from renderer.drawing.drawing import Drawing
    from renderer.drawing.opengl import open_context
    from renderer.encoding.encoder import open_encoder
    from renderer.shapes.prepare import prepared as prepared_shape
    from robots.descriptions.description import load
    from robots.descriptions.glb import link_glbs
    from robots.kinematics.model import build_model, link_placements

    size = (1280, 720)
    description = load("pt600")
    model = build_model(description)
    drawing, encoder = Drawing(open_context(None), size, samples=0), open_encoder(size, 30)
    shapes = {name: prepared_shape(glb) for name, glb in link_glbs(description).items()}
    for name, mesh in shapes.items():
        drawing.add(name, mesh)
    for number in range(PICTURES):
        positions = model.joints.home + 0.3 * np.sin(number / 15)
        placements = dict(zip(model.link_names, link_placements(model, positions), strict=True))
        scene, camera = view(shapes, placements, size)
        packet = encoder.encode(drawing.draw(scene, camera), key_frame=number == 0)
        yield CompressedVideo(frame_id="bench", data=packet.data, format="h264").SerializeToString()
    drawing.close()
