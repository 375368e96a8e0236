"""From a unit's records to what the controller is to do: all of it, or a refusal and nothing.

The unit is rehearsed on a copy of the state before anything is done, so that `reset` allows the
move behind it, and a target beyond a limit takes the words before it with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from protocol_gateway.core.records import (
    AbsolutePositions,
    Command,
    Error,
    Record,
    RelativePositions,
    Unknown,
    speed_percent,
)
from protocol_gateway.core.scales import si_scales
from protocol_gateway.errors import UnitError
from robots.joints import FloatArray, Joints, violations

MALFORMED, UNKNOWN_WORD, JOINT_COUNT, LIMIT, LOCAL, STOPPED, FAULT = 2, 3, 4, 5, 6, 8, 9

_WORDS = ("trace", "untrace", "home", "stop", "hold", "resume", "reset")


@dataclass(frozen=True, eq=False)
class Word:
    """A command of one word."""

    word: str


@dataclass(frozen=True)
class SetSpeed:
    """A fraction of the greatest speeds, 0.01 to 1."""

    fraction: float


@dataclass(frozen=True, eq=False)
class Move:
    """Go to a target [rad] or [m]; homing goes slower, and finds the reference marks at its end."""

    target: FloatArray
    homing: bool = False


Order: TypeAlias = Word | SetSpeed | Move


@dataclass(frozen=True, eq=False)
class Situation:
    """What decides whether an order can be done.

    Attributes:
        where: (n,) where the arm will be when the next motion begins [rad] or [m].
    """

    stopped: bool
    held: bool
    where: FloatArray


def orders_of(records: Sequence[Record], joints: Joints, situation: Situation) -> list[Order] | Error:
    """The orders of a client's unit, or the record that refuses it."""
    orders: list[Order] = []
    for record in records:
        rehearsed = _rehearsed(record, joints, situation)
        if isinstance(rehearsed, Error):
            return rehearsed
        for order in rehearsed:
            if refusal := _refusal(order, joints, situation):
                return refusal
            orders.append(order)
            situation = _after(order, situation)
    return orders


def asks_to_stop(records: Sequence[Record]) -> bool:
    """Whether a unit holds a stop: done even when the rest of the unit is refused."""
    return any(isinstance(record, Command) and "stop" in record.words for record in records)


def _rehearsed(record: Record, joints: Joints, situation: Situation) -> Sequence[Order] | Error:
    match record:
        case Command(words):
            orders = [_word(word, joints) for word in words]
            return next((order for order in orders if isinstance(order, Error)), None) or [
                order for order in orders if not isinstance(order, Error)
            ]
        case AbsolutePositions(values) | RelativePositions(values):
            if len(values) != len(joints):
                return Error(JOINT_COUNT, f"{len(values)} values for {len(joints)} joints")
            origin = situation.where if isinstance(record, RelativePositions) else np.zeros(len(joints))
            return (Move(origin + np.array(values) * si_scales(joints.types)),)
        case Unknown(type_name):
            return Error(UNKNOWN_WORD, f"unknown type {type_name[:40]}")
        case _:
            # Data about somebody's state or clock, or an answer: it asks for nothing.
            return ()


def _word(word: str, joints: Joints) -> Order | Error:
    if word == "home":
        return Move(joints.home, homing=True)
    if word in _WORDS:
        return Word(word)
    try:
        percent = speed_percent(word)
    except UnitError as error:
        return Error(MALFORMED, f"speed {error}")
    if percent is None:
        return Error(UNKNOWN_WORD, f"unknown word {word[:40]}, known: {' '.join(_WORDS)} speed=NN")
    if not 1.0 <= percent <= 100.0:
        return Error(LIMIT, f"speed {percent:g} is outside 1-100 %")
    return SetSpeed(percent / 100.0)


def _refusal(order: Order, joints: Joints, situation: Situation) -> Error | None:
    if not isinstance(order, Move):
        return None
    if situation.stopped:
        return Error(STOPPED, "stopped, reset first")
    if situation.held:
        return Error(STOPPED, "holding, resume or reset first")
    if beyond := violations(joints, order.target):
        # Units are ASCII.
        return Error(LIMIT, beyond[0].text.replace("°", " deg"))
    return None


def _after(order: Order, situation: Situation) -> Situation:
    match order:
        case Move(target):
            return replace(situation, where=target)
        case Word("stop"):
            return replace(situation, stopped=True, held=False)
        case Word("reset"):
            return replace(situation, stopped=False, held=False)
        case Word("hold"):
            return replace(situation, held=not situation.stopped)
        case Word("resume"):
            return replace(situation, held=False)
        case _:
            return situation
