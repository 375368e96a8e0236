"""`robomesh snapshot`: a rendered picture in a file."""

from pathlib import Path

from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from bus.keys import check_chunk, robot_key
from services.command_line import find
from services.errors import ServiceError


class NoPictureError(ServiceError):
    """Nobody draws the view."""


def run(robot: str, view: str, out: Path, router: str) -> None:
    """Save the picture; PNG, JPEG or whatever else the file's name says."""
    check_chunk(view, "view")
    picture = find.run(_picture(robot, view, router))
    if out.suffix.lower() in (".jpg", ".jpeg"):
        data = picture
    else:
        import cv2
        import numpy as np

        image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
        if image is None:
            raise NoPictureError(f"what came for {view!r} is no picture")
        try:
            done, encoded = cv2.imencode(out.suffix or ".png", image)
        except cv2.error:
            done = False
        if not done:
            raise NoPictureError(f"{out}: no picture format {out.suffix!r}; .png and .jpg are right")
        data = encoded.tobytes()
    try:
        out.write_bytes(data)
    except OSError as error:
        raise NoPictureError(f"{out}: cannot be written: {error.strerror}") from None
    print(out)


async def _picture(name: str, view: str, router: str) -> bytes:
    async with find.attached(router) as session:
        robot = await find.find(session, name)
        message = await session.last(robot_key(*robot, f"image/{view}"), timeout_s=5.0)
        if not isinstance(message, CompressedImage):
            raise NoPictureError(
                f"no picture of {robot} from {view!r}: is the renderer running, and has it that view?"
            )
        return bytes(message.data)
