"""Answers to commands and stops, callbacks while a command runs, and the text of a teach program."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from robomesh.errors import MessageError
from robomesh.keys import robot_key
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import Session


@dataclass(frozen=True)
class StopResult:
    """Answer to a stop.

    Attributes:
        id: Number of the latched stop; 0: none was latched.
        sent: The stop unit is on the controller's socket; False: it is latched, and sent later.
        text: Sentence for people.
    """

    id: int
    sent: bool
    text: str


@dataclass(frozen=True)
class CommandResult:
    """Answer to an accepted command.

    Attributes:
        text: Sentence for people.
        warning: Warning of the check; empty: none.
    """

    text: str
    warning: str = ""


@dataclass(frozen=True)
class Progress:
    """Callbacks of a program that waits for the end of its command.

    Attributes:
        on_accepted: Called with the answer of a command whose end is waited for.
        on_step: Called with each new line of the program that the gateway runs.
        is_alive: Returns whether the program still waits; if not, the lease is not renewed.
        stop_reason: Reason of the stop that ends an interrupted motion.
    """

    on_accepted: Callable[[CommandResult], None] = lambda answer: None
    on_step: Callable[[schema.ProgramState], None] = lambda state: None
    is_alive: Callable[[], bool] = lambda: True
    stop_reason: str = "the program was interrupted"


async def request_stop(session: Session, site: str, robot: str, by: str, reason: str) -> StopResult:
    """Request a stop of a robot in an operator's name.

    Raises:
        NoAnswerError: If no gateway answered: the robot may still move.
    """
    answer = await session.ask(robot_key(site, robot, "stop"), schema.StopRequest(by=by, reason=reason))
    assert isinstance(answer, schema.StopAnswer)
    return StopResult(answer.stop_id, answer.sent, answer.text)


def program_text(program: str | Path) -> str:
    """Return a program's text.

    Raises:
        MessageError: If its file cannot be read.
    """
    if not isinstance(program, Path):
        return program
    try:
        return program.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
        raise MessageError(f"{program}: cannot be read: {reason}") from None
