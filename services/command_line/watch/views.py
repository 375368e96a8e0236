"""The keys of a robot's view, for a command that saves its video or pictures."""

import contextlib
from typing import NamedTuple

from robomesh.contract.keys import check_chunk, robot_key
from robomesh.errors import NoAnswerError, RobomeshError
from robomesh.schemas.robomesh_pb2 import KeyFrameRequest, ViewAnswer, ViewRequest
from robomesh.wire.session import Session
from services.command_line.terminal import discovery
from services.errors import ServiceError

# The first view on a busy machine opens an encoder.
_TIMEOUT_S = 5.0
_RATE_TIMEOUT_S = 1.0


class NoRendererError(ServiceError):
    """No renderer draws the robot."""


class View(NamedTuple):
    """The keys of a view's video and pictures, and its highest rate [1/s]; 0: unknown."""

    video: str
    image: str
    fps: float = 0.0


async def view_of(
    session: Session,
    robot: discovery.RobotAddress,
    name: str,
    *,
    width: int = 0,
    height: int = 0,
    fps: float = 0.0,
) -> View:
    """Return a view by its name, in the requested size and rate if given.

    Raises:
        RefusedError: If the renderer has no view of that name or size; the text lists its views.
        NoRendererError: If no renderer answers.
    """
    check_chunk(name, "view")
    try:
        if width or height or fps:
            request = ViewRequest(of=name, width=width, height=height, fps=fps)
            answer = await session.ask(_views_key(session, robot), request, timeout_s=_TIMEOUT_S)
            assert isinstance(answer, ViewAnswer)
            return View(robot_key(*robot, answer.topic), robot_key(*robot, answer.image), answer.fps)
        view = View(robot_key(*robot, f"video/{name}"), robot_key(*robot, f"image/{name}"))
        # A renderer without the view refuses, and lists its views.
        key = f"{view.video}/keyframe/{session.own_name}"
        await session.ask(key, KeyFrameRequest(), timeout_s=_TIMEOUT_S)
        return view._replace(fps=await _rate(session, robot, name))
    except NoAnswerError:
        raise NoRendererError(
            f"no renderer draws {robot}: is the renderer of {robot.site} running?"
        ) from None


def _views_key(session: Session, robot: discovery.RobotAddress) -> str:
    return robot_key(*robot, f"views/{session.own_name}")


async def _rate(session: Session, robot: discovery.RobotAddress, name: str) -> float:
    """Return a view's highest rate [1/s]; 0: a recording's view, without a renderer."""
    with contextlib.suppress(RobomeshError):
        answer = await session.ask(
            _views_key(session, robot), ViewRequest(of=name), timeout_s=_RATE_TIMEOUT_S
        )
        assert isinstance(answer, ViewAnswer)
        return answer.fps
    return 0.0
