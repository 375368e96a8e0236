"""Control groups, and the relation between pulses and joint positions.

The controller reports pulses of its motors' encoders. How many make a degree, in which direction, and which
axes are coupled by gears, depends on the robot's type, and the controller does not say it:

    pulses of an axis = pulses_per_degree * (position - zero) + sum of coupling * (position - zero) of others
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from protocol_gateway.seam.errors import GatewaySettingsError
from robots.kinematics.joints import FloatArray, JointType

MOST_AXES = 8
# Of a simulated controller.
_PULSES_PER_DEGREE = 1000.0
# Before the number in a control group's name: first instance, and number of groups.
_GROUPS = {"R": (1, 8), "B": (11, 8), "S": (21, 24)}
_WORST_CONDITION = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Coupling:
    """Pulses that one joint's motion adds to another's axis.

    Attributes:
        joint: Number of the joint with the coupled axis, from 1.
        by: Number of the joint that moves.
        pulses_per_degree: Added pulses a degree (a millimetre) of that joint.
    """

    joint: int
    by: int
    pulses_per_degree: float


@dataclass(frozen=True, slots=True, kw_only=True)
class YaskawaSettings:
    """Properties of a Yaskawa robot that the site file declares.

    Attributes:
        pulses_per_degree: One a joint, negative where the joint turns the other way; of a linear joint, a
            millimetre. Empty: undeclared, joints are not shown.
        axes: Number of each joint's axis in the controller's order, from 1; empty: 1, 2, 3, ...
        other_axes: Numbers of axes that are no joints of the model, and neither carry nor move the arm.
        zero: Position of each joint at 0 pulses [degree] or [mm]; empty: 0.
        coupling: Axes that turn with another joint, as in many wrists.
        group: Control group: R1 to R8, B1 to B8, S1 to S24.
        rate_hz: Positions a second.
        io: Groups of eight inputs or outputs that are read: 1 is the first of the user's inputs, 1001 of the
            outputs.
        motion: The gateway may move the robot (`motion_driver`).
    """

    pulses_per_degree: Sequence[float] = ()
    axes: Sequence[int] = ()
    other_axes: Sequence[int] = ()
    zero: Sequence[float] = ()
    coupling: Sequence[Coupling] = ()
    group: str = "R1"
    rate_hz: float = 20.0
    io: Sequence[int] = (1, 1001)
    motion: bool = False


def instance_of(group: str) -> int:
    """Return the number of a control group in questions.

    Raises:
        GatewaySettingsError: If there is no such group.
    """
    match = re.fullmatch(r"([RBS])([1-9]\d?)", group)
    first, count = _GROUPS[match[1]] if match else (0, 0)
    if match is None or int(match[2]) > count:
        raise GatewaySettingsError(f"group {group!r}: must be R1 to R8, B1 to B8 or S1 to S24")
    return first + int(match[2]) - 1


class Axes:
    """Linear relation between pulses and joint positions.

    Attributes:
        used: Axis of each joint, from 0.
        mapping: The relation as text.

    Args:
        joint_types: Types of the model's joints.

    Raises:
        GatewaySettingsError: If the settings do not fit the model, or cannot be inverted.
    """

    def __init__(self, settings: YaskawaSettings, joint_types: Sequence[JointType]) -> None:
        joints = len(joint_types)
        for name in ("pulses_per_degree", "axes", "zero"):
            given = getattr(settings, name)
            if given and len(given) != joints:
                raise GatewaySettingsError(
                    f"yaskawa {name} has {len(given)} values, but the model has {joints} joints"
                )
        numbers = [*(settings.axes or range(1, joints + 1))]
        if sorted({*numbers}) != sorted(numbers) or not all(1 <= each <= MOST_AXES for each in numbers):
            raise GatewaySettingsError(
                f"yaskawa axes: {MOST_AXES} at most, numbered from 1, each of one joint; "
                f"{', '.join(map(str, numbers))} were given"
            )
        self.used = tuple(each - 1 for each in numbers)
        # Of a degree or a millimetre, in SI.
        units = np.array([math.radians(1.0) if each is JointType.ROTARY else 1e-3 for each in joint_types])
        self._zero = np.array(settings.zero or [0.0] * joints) * units
        matrix = np.diag(np.array(settings.pulses_per_degree) / units)
        for each in settings.coupling:
            if not (1 <= each.joint <= joints and 1 <= each.by <= joints) or each.joint == each.by:
                raise GatewaySettingsError(
                    f"yaskawa coupling of joint {each.joint} by {each.by}: two of the joints 1 to {joints}"
                )
            matrix[each.joint - 1, each.by - 1] = each.pulses_per_degree / units[each.by - 1]
        if not np.all(np.isfinite(matrix)) or np.linalg.cond(matrix) > _WORST_CONDITION:
            raise GatewaySettingsError(
                "yaskawa pulses_per_degree and coupling: pulses do not determine the joints; none may be 0"
            )
        self._matrix, self._inverse = matrix, np.linalg.inv(matrix)
        self.mapping = repr((settings.group, numbers, self._zero.tolist(), matrix.tolist()))

    def positions(self, pulses: Sequence[int]) -> tuple[float, ...]:
        """Return joint positions [rad] or [m].

        Args:
            pulses: All values of a position's axes.

        Raises:
            ValueError: If there are fewer axes than the joints need.
        """
        if max(self.used) >= len(pulses):
            raise ValueError(f"axis {max(self.used) + 1} is declared, the controller sends {len(pulses)}")
        chosen = np.array([pulses[each] for each in self.used], dtype=float)
        found: list[float] = (self._inverse @ chosen + self._zero).tolist()
        return tuple(found)

    def pulses(self, positions: FloatArray) -> tuple[int, ...]:
        """Return the pulses of eight axes at joint positions (n,) [rad] or [m]; 0 of axes without a joint."""
        exact = self._matrix @ (positions - self._zero)
        found = [0] * MOST_AXES
        for axis, value in zip(self.used, exact, strict=True):
            found[axis] = round(value)
        return tuple(found)


def with_factors(declared: YaskawaSettings | None, joints: int) -> YaskawaSettings:
    """Return the settings of a simulated controller: as declared, with its own factors if there are none."""
    settings = declared or YaskawaSettings()
    if settings.pulses_per_degree:
        return settings
    return replace(settings, pulses_per_degree=(_PULSES_PER_DEGREE,) * joints)
