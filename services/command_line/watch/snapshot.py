"""`robomesh snapshot`: a rendered picture, saved to a file."""

from pathlib import Path
from typing import Annotated

import typer
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.terminal import discovery
from services.command_line.terminal.options import Connect, Height, Robot, Width, command_group
from services.command_line.terminal.output import print_line
from services.command_line.watch.views import view_of
from services.errors import ServiceError

app = command_group()

# On a busy machine the first picture of a robot with many parts takes seconds.
_TIMEOUT_S = 15.0


class NoPictureError(ServiceError):
    """No picture arrived, or it cannot be written."""


@app.command()
def snapshot(
    robot: Robot,
    view: Annotated[str, typer.Argument(metavar="VIEW", help="front, top, left, free, ...")],
    out: Annotated[Path, typer.Argument(metavar="OUT.png")],
    width: Width = 0,
    height: Height = 0,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Save a rendered picture of a robot."""
    picture = discovery.run(_picture(robot, view, (width, height), connect))
    if out.suffix.lower() in (".jpg", ".jpeg"):
        data = picture
    else:
        import cv2
        import numpy as np

        image = cv2.imdecode(np.frombuffer(picture, np.uint8), cv2.IMREAD_COLOR)
        if image is None:
            raise NoPictureError(f"view {view!r}: the renderer sent no valid picture")
        try:
            done, encoded = cv2.imencode(out.suffix or ".png", image)
        except cv2.error:
            done = False
        if not done:
            raise NoPictureError(f"{out}: unknown picture format {out.suffix!r}; must be .png or .jpg")
        data = encoded.tobytes()
    try:
        out.write_bytes(data)
    except OSError as error:
        raise NoPictureError(f"{out}: cannot be written: {error.strerror}") from None
    print_line(out)


async def _picture(name: str, view: str, size: tuple[int, int], router: str) -> bytes:
    async with discovery.attached(router) as session:
        robot = await discovery.find(session, name)
        keys = await view_of(session, robot, view, width=size[0], height=size[1])
        message = await session.last(keys.image, timeout_s=_TIMEOUT_S)
        if not isinstance(message, CompressedImage):
            raise NoPictureError(
                f"no picture of {robot} from {view!r} within {_TIMEOUT_S:g} s: see the renderer's log"
            )
        return bytes(message.data)
