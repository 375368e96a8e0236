"""Effects that a driver returns, and the channels that they use."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Flag, auto
from typing import TypeAlias

from protocol_gateway.seam.events import ControllerEvent
from robomesh.reasons import Reason


class Carries(Flag):
    """Functions that depend on a channel."""

    READING = auto()
    MOTION = auto()
    STOP = auto()


ALL = Carries.READING | Carries.MOTION | Carries.STOP
"""All of it: a protocol with a single channel."""

NOTHING = Carries(0)
"""An addition to another channel."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """One of a driver's connections to the controller.

    Attributes:
        name: Its name in the site file's `ports`, and in events.
        carries: What needs it. The robot is shown as disconnected while no channel that carries READING is
            open, so an addition to another channel carries nothing.
        datagrams: UDP instead of TCP; `received` gets each datagram by itself.
        program: Module that reads the controller in a process of its own, because a library owns its sockets;
            empty: there is none. `received` gets what it prints. It has no input, so `Send` fails.
        brief: The driver opens it again and again, each time for one file: its connections are not counted,
            and their ends not reported.
    """

    name: str
    carries: Carries
    datagrams: bool = False
    program: str = ""
    brief: bool = False


@dataclass(frozen=True, slots=True)
class Open:
    """Connect a channel, and connect it again after it was lost, with growing pauses, until `Close`.

    Attributes:
        port: Port of the controller's host, unless the site file's `ports` has another one; None: that of
            the site file's `controller`.
        settings: What a channel's program is started with, besides host and port.
    """

    channel: Channel
    port: int | None = None
    settings: str = ""


@dataclass(frozen=True, slots=True)
class Close:
    """End a channel, and do not connect it again.

    Attributes:
        why: Description of the error in the controller's bytes, shown as the reason; empty: no error.
    """

    channel: Channel
    why: str = ""


@dataclass(frozen=True, slots=True)
class Send:
    """Write whole bytes to a channel now. Nothing waits in the gateway, so nothing precedes a stop.

    Attributes:
        alternative: Another `Send` of the same command has the same purpose, as a second way to stop: the
            command fails only if all of them fail. Otherwise the first failure ends the command.
    """

    channel: Channel
    data: bytes
    alternative: bool = False


@dataclass(frozen=True, slots=True)
class SetTimer:
    """Call `timer_ended` at a time [s]; it replaces the timer of this name. None: clear it.

    With `FateUnknown`, timers are set before the other effects, because the stop may set them too.
    """

    at_s: float | None
    name: str = ""


@dataclass(frozen=True, slots=True)
class Report:
    """Report of a controller, from the bytes of one read.

    Attributes:
        units: Number of well-formed units; one may give several events, or none.
        refusals: Number of these units that hold only refusals, so do not show that the arm's state is
            received.
        asked_s: Time of the question that they answer, on the gateway's clock. The values are of some moment
            since then, so they are stamped with the middle; None: they were not asked for.
        lost: Number of questions that were not answered in time.
    """

    events: Sequence[ControllerEvent]
    units: int
    refusals: int = 0
    asked_s: float | None = None
    lost: int = 0


@dataclass(frozen=True, slots=True)
class FateUnknown:
    """Latch a stop in the gateway: the outcome of a motion, or the present motion of the arm, is unknown.

    The driver has already done what it can by itself, and never sends the motion again.
    """

    why: Reason


Effect: TypeAlias = Open | Close | Send | SetTimer | Report | FateUnknown

Effects: TypeAlias = Sequence[Effect]
