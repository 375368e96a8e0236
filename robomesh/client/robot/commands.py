"""Answers to commands and stops, callbacks while a command runs, and the text of a teach program."""

import contextlib
from collections.abc import Callable, Iterable, Mapping, Set
from dataclasses import dataclass
from pathlib import Path

from robomesh.contract.keys import robot_key
from robomesh.errors import MessageError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.texts import one_line
from robomesh.wire.session import Session

# The services' limits are lower; a longer text is lost on its way to them.
_LONGEST_PROGRAM = 1 << 20
_LONGEST_SHOWN = 100


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
class JogResult:
    """End of a jog.

    Attributes:
        distance: Distance from its beginning [m], or [rad] if `rotary`.
        text: Why it ended, for people.
        code: Code of the reason: "jog.released", "jog.not_alive", "joints.outside", ...
    """

    distance: float
    rotary: bool
    text: str
    code: str


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

    Args:
        reason: For people; a reason that is too long or no valid text does not prevent the stop.

    Raises:
        NoAnswerError: If no gateway answered: the robot may still move.
    """
    request = schema.StopRequest(by=by, reason=one_line(str(reason)))
    answer = await session.ask(robot_key(site, robot, "stop"), request)
    assert isinstance(answer, schema.StopAnswer)
    return StopResult(answer.stop_id, answer.sent, answer.text)


def program_text(program: str | Path) -> str:
    """Return a program's text.

    Raises:
        MessageError: If its file cannot be read, or it is too long or not UTF-8 text.
    """
    try:
        if isinstance(program, Path):
            with program.open("rb") as stream:
                text = stream.read(_LONGEST_PROGRAM + 1).decode()
        else:
            text = program
            text.encode()
            if text.endswith(".program") and "\n" not in text:
                raise MessageError(
                    f"{text!r} names a file, and is not a program's text: write Path({text!r})"
                )
    except UnicodeError:
        raise MessageError(f"{_name(program)}: cannot be read: it is not UTF-8 text") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise MessageError(f"{_name(program)}: cannot be read: {reason}") from None
    if len(text) > _LONGEST_PROGRAM:
        raise MessageError(
            f"{_name(program)}: has more than {_LONGEST_PROGRAM >> 20} MiB, and is not a program"
        )
    return text


def numbers(values: Iterable[float]) -> list[float]:
    """Return joint positions or distances as numbers.

    Raises:
        MessageError: If they are not a sequence of numbers.
    """
    # Iterable too, but not in the order of the joints: the characters of a text, the keys of a mapping.
    if not isinstance(values, str | bytes | bytearray | Mapping | Set):
        with contextlib.suppress(TypeError, ValueError, OverflowError):
            return [float(value) for value in values]
    shown = one_line(repr(values), _LONGEST_SHOWN)
    raise MessageError(f"{shown} is not a sequence of numbers, one for each joint")


def _name(program: str | Path) -> str:
    return str(program) if isinstance(program, Path) else "the program"
