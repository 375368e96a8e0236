"""Settings of a FANUC robot, and the relation between its axes and the model's joints.

The controller reports degrees and millimetres. In most of its arms, axis 3 does not turn against link 2: its
value is the angle of the forearm to the horizontal, so it changes when axis 2 moves:

    angle between the links = J3 + j23 * J2        position = ±angle + zero
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from controllers.fanuc.assignments import Table
from controllers.fanuc.data import AXES
from controllers.fanuc.srtp import Area
from protocol_gateway.seam.errors import GatewaySettingsError
from robots.kinematics.joints import FloatArray, JointType

_SIGNALS = re.compile(r"(DI|DO|RI|RO|UI|UO)\[([1-9]\d{0,3})(?:-([1-9]\d{0,3}))?\]")
MOST_SIGNALS = 128
LEAST_MOTION_RATE_HZ = 5.0
ANONYMOUS = "anonymous"


@dataclass(frozen=True, slots=True)
class SignalBits:
    """Inputs or outputs that one question reads.

    Attributes:
        kind: DI, DO, RI, RO, UI or UO.
        first, last: Numbers on the pendant.
    """

    kind: str
    first: int
    last: int

    @property
    def area(self) -> Area:
        """Area of their bits."""
        return Area.ROBOT_INPUTS if self.kind[1] == "I" else Area.ROBOT_OUTPUTS

    @property
    def first_bit(self) -> int:
        """Number of the first one's bit in its area, from 0."""
        return {"D": 0, "R": 5000, "U": 6000}[self.kind[0]] + self.first - 1


def signal_bits(text: str) -> SignalBits:
    """Parse inputs or outputs, such as "DI[1-16]" and "RO[7]".

    Raises:
        GatewaySettingsError: If the text is not of this form, or means too many.
    """
    match = _SIGNALS.fullmatch(text)
    if match:
        found = SignalBits(match[1], int(match[2]), int(match[3] or match[2]))
        if 0 <= found.last - found.first < MOST_SIGNALS:
            return found
    raise GatewaySettingsError(
        f"io {text!r}: must be DI, DO, RI, RO, UI or UO with at most {MOST_SIGNALS} numbers, as in DI[1-16]"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class FanucSettings:
    """Properties of a FANUC robot that the site file declares.

    Attributes:
        assignments: "own": the gateway makes a table of assignments for its connection. "pendant": an
            operator has entered the assignments. None: undeclared, joints are not shown.
        j23: Factor of axis 2 in the angle of axis 3: 1, 0 or -1. None: undeclared, joints are not shown.
        axes: Number of each joint's axis in the controller's order, from 1; empty: 1, 2, 3, ...
        other_axes: Numbers of axes that are no joints of the model, and neither carry nor move the arm.
        reversed: Numbers of the joints that turn the other way, from 1.
        zero: Position of each joint where its axis is at 0 [degree] or [mm]; empty: 0.
        group: Motion group, 1 to 8.
        rate_hz: Positions a second.
        tools: Numbers of the tools with a frame to read.
        registers: Numbers of the numeric registers to read.
        io: Inputs and outputs to read: "DI[1-16]".
        motion: The gateway moves the robot by RMI; otherwise it only reads.
        speed_percent: Speed of a motion at 100 percent, in percent of the arm's greatest.
        user: User of the controller's FTP server.
        password_file: File with that user's password, which only its owner may read; empty: no password.
    """

    assignments: Literal["own", "pendant"] | None = None
    j23: Literal[-1, 0, 1] | None = None
    axes: Sequence[int] = ()
    other_axes: Sequence[int] = ()
    reversed: Sequence[int] = ()
    zero: Sequence[float] = ()
    group: int = 1
    rate_hz: float = 20.0
    tools: Sequence[int] = (1,)
    registers: Sequence[int] = ()
    io: Sequence[str] = ("DI[1-16]", "DO[1-16]", "RI[1-8]", "RO[1-8]")
    motion: bool = False
    speed_percent: float = 20.0
    user: str = ANONYMOUS
    password_file: str = ""

    @property
    def motion_problem(self) -> str | None:
        """Error of settings that do not suffice for motion; None: they do."""
        if self.assignments is None or self.j23 is None:
            return "motion: needs assignments and j23, because a motion is followed by the joints"
        if self.rate_hz < LEAST_MOTION_RATE_HZ:
            return f"motion: needs a rate of at least {LEAST_MOTION_RATE_HZ:g} positions a second"
        return None

    @property
    def table(self) -> Table:
        """The assignments.

        Raises:
            GatewaySettingsError: If group, tools or registers are invalid.
        """
        try:
            return Table(self.group, self.tools, self.registers, own=self.assignments != "pendant")
        except ValueError as error:
            raise GatewaySettingsError(f"fanuc {error}") from None


class Axes:
    """Relation between the controller's axes and joint positions.

    Attributes:
        used: Axis of each joint, from 0.
        mapping: The relation as text.

    Args:
        settings: With j23.
        joint_types: Types of the model's joints.

    Raises:
        GatewaySettingsError: If the settings do not fit the model.
    """

    def __init__(self, settings: FanucSettings, joint_types: Sequence[JointType]) -> None:
        joints = len(joint_types)
        for name in ("axes", "zero"):
            given = getattr(settings, name)
            if given and len(given) != joints:
                raise GatewaySettingsError(
                    f"fanuc {name} has {len(given)} values, but the model has {joints} joints"
                )
        numbers = [*(settings.axes or range(1, joints + 1))]
        if len({*numbers}) != len(numbers) or not all(1 <= each <= AXES for each in numbers):
            raise GatewaySettingsError(
                f"fanuc axes: {AXES} at most, numbered from 1, each of one joint; "
                f"{', '.join(map(str, numbers))} were given"
            )
        if not all(1 <= each <= joints for each in settings.reversed):
            raise GatewaySettingsError(f"fanuc reversed: must be numbers of joints, 1 to {joints}")
        self.used = tuple(each - 1 for each in numbers)
        linear = [
            number for number, each in zip(numbers, joint_types, strict=True) if each is not JointType.ROTARY
        ]
        if settings.j23 and {2, 3} & {*linear}:
            raise GatewaySettingsError("fanuc j23: must be 0, because only rotary axes can be coupled")
        self._j23 = settings.j23 or 0
        # Of a degree or a millimetre, in SI.
        units = np.array([math.radians(1.0) if each is JointType.ROTARY else 1e-3 for each in joint_types])
        signs = np.array([-1.0 if each + 1 in settings.reversed else 1.0 for each in range(joints)])
        self._scale = signs * units
        self._zero = np.array(settings.zero or [0.0] * joints) * units
        self.mapping = repr((settings.group, numbers, self._j23, self._scale.tolist(), self._zero.tolist()))

    def positions(self, axes: Sequence[float]) -> tuple[float, ...]:
        """Return joint positions [rad] or [m].

        Args:
            axes: Nine values [degree] or [mm].
        """
        values = [*axes]
        values[2] += self._j23 * values[1]
        found: list[float] = (
            np.array([values[each] for each in self.used]) * self._scale + self._zero
        ).tolist()
        return tuple(found)

    def values(self, positions: FloatArray) -> tuple[float, ...]:
        """Return nine axes [degree] or [mm] at joint positions (n,) [rad] or [m]; 0 if no joint has one."""
        found = [0.0] * AXES
        for axis, value in zip(self.used, (positions - self._zero) / self._scale, strict=True):
            found[axis] = float(value)
        found[2] -= self._j23 * found[1]
        return tuple(found)


def with_defaults(declared: FanucSettings | None, joint_types: tuple[JointType, ...]) -> FanucSettings:
    """Return the settings of a simulated controller: as declared, and what the site file leaves open.

    It keeps a table of assignments for each connection, and axis 3 contains axis 2 if both turn.
    """
    settings = declared or FanucSettings()
    if settings.assignments is None:
        settings = replace(settings, assignments="own")
    if settings.j23 is None:
        turn = all(each is JointType.ROTARY for each in joint_types)
        settings = replace(settings, j23=1 if turn else 0)
    return settings
