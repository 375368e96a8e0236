"""Validation of a client's unit: the orders for the controller, or one refusal of the whole unit.

The unit is first applied to a copy of the state, so that `reset` permits the move after it, and a target
beyond a limit also refuses the words before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from protocol_gateway.seam.errors import UnitError
from protocol_gateway.unit_protocol.records import (
    AbsolutePositions,
    Command,
    Error,
    Record,
    RelativePositions,
    Unknown,
    speed_percent,
)
from protocol_gateway.unit_protocol.scales import si_scales
from robots.kinematics.joints import FloatArray, Joints, violations

MALFORMED, UNKNOWN_WORD, JOINT_COUNT, LIMIT, LOCAL, STOPPED, FAULT = 2, 3, 4, 5, 6, 8, 9

_WORDS = ("trace", "untrace", "home", "stop", "hold", "resume", "reset")


@dataclass(frozen=True, eq=False)
class Word:
    """A command of one word."""

    word: str


@dataclass(frozen=True)
class SetSpeed:
    """A change of speed, as a fraction 0.01 to 1 of the maximum speeds."""

    fraction: float


@dataclass(frozen=True, eq=False)
class Move:
    """A motion to a target [rad] or [m]; homing is slower and finds the reference marks at its end."""

    target: FloatArray
    homing: bool = False


Order: TypeAlias = Word | SetSpeed | Move


@dataclass(frozen=True, eq=False)
class Situation:
    """State that decides whether an order is permitted.

    Attributes:
        positions: (n,) positions at which the next motion begins [rad] or [m].
    """

    stopped: bool
    holding: bool
    positions: FloatArray


def orders_of(records: Sequence[Record], joints: Joints, situation: Situation) -> list[Order] | Error:
    """Return the orders of a client's unit, or the error record that refuses it."""
    orders: list[Order] = []
    for record in records:
        found = _orders_of_record(record, joints, situation)
        if isinstance(found, Error):
            return found
        for order in found:
            if refusal := _refusal(order, joints, situation):
                return refusal
            orders.append(order)
            situation = _after(order, situation)
    return orders


def _orders_of_record(record: Record, joints: Joints, situation: Situation) -> Sequence[Order] | Error:
    match record:
        case Command(words):
            orders = [_word(word, joints) for word in words]
            return next((order for order in orders if isinstance(order, Error)), None) or [
                order for order in orders if not isinstance(order, Error)
            ]
        case AbsolutePositions(values) | RelativePositions(values):
            if len(values) != len(joints):
                return Error(JOINT_COUNT, f"{len(values)} values for {len(joints)} joints")
            origin = situation.positions if isinstance(record, RelativePositions) else np.zeros(len(joints))
            return (Move(origin + np.array(values) * si_scales(joints.types)),)
        case Unknown(type_name):
            return Error(UNKNOWN_WORD, f"unknown type {type_name[:40]}")
        case _:
            # State, time or an answer: not a request.
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
    if situation.holding:
        return Error(STOPPED, "holding, resume or reset first")
    if beyond := violations(joints, order.target):
        # Units are ASCII.
        return Error(LIMIT, beyond[0].text.replace("°", " deg"))
    return None


def _after(order: Order, situation: Situation) -> Situation:
    match order:
        case Move(target):
            return replace(situation, positions=target)
        case Word("stop"):
            return replace(situation, stopped=True, holding=False)
        case Word("reset"):
            return replace(situation, stopped=False, holding=False)
        case Word("hold"):
            return replace(situation, holding=not situation.stopped)
        case Word("resume"):
            return replace(situation, holding=False)
        case _:
            return situation
