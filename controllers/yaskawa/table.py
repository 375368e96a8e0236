"""The site file's part on a robot of Yaskawa."""

from collections.abc import Sequence
from typing import Annotated, TypeAlias

from pydantic import Field, StrictBool, field_validator

from controllers.yaskawa.axes import MOST_AXES, Coupling, YaskawaSettings, instance_of, with_factors
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.table import Declared, Table
from robots.kinematics.joints import JointType
from robots.schema.toml_table import TomlTable

_Axis: TypeAlias = Annotated[int, Field(ge=1, le=MOST_AXES, strict=True)]


class CoupledAxis(TomlTable):
    """Pulses that one joint's motion adds to another joint's axis, as in many wrists.

    Attributes:
        joint: Number of the joint with the coupled axis, from 1.
        by: Number of the joint that moves.
        pulses_per_degree: Added pulses a degree of that joint; of a linear joint, a millimetre.
    """

    joint: _Axis
    by: _Axis
    pulses_per_degree: float


class Yaskawa(Table):
    """Properties of a robot that its Yaskawa controller does not report (docs/controllers/yaskawa.md).

    Attributes:
        pulses_per_degree: Pulses a degree of each joint, negative where the model's joint turns the other
            way; of a linear joint, a millimetre. Empty: the joints are not shown.
        axes: Number of each joint's axis in the controller's order (S, L, U, R, B, T, E, W), from 1; empty:
            1, 2, 3, ...
        other_axes: Numbers of axes of the group that are no joints of the model, and neither carry nor move
            the arm, as a servo gun's. With other axes than these the robot is read-only.
        zero: Position of each joint at 0 pulses [deg], or [mm]; empty: 0.
        coupling: Axes that turn with another joint.
        group: Control group: R1 to R8, B1 to B8, S1 to S24.
        rate: Positions a second.
        io: Groups of eight inputs or outputs to read twice a second: 1 to 512 are the user's inputs, 1001 to
            1512 the outputs; at most 16.
        motion: The gateway moves the robot, experimentally (docs/controllers/yaskawa.md#motion); otherwise
            it only reads.
    """

    pulses_per_degree: tuple[float, ...] = ()
    axes: tuple[_Axis, ...] = ()
    other_axes: tuple[_Axis, ...] = ()
    zero: tuple[float, ...] = ()
    coupling: tuple[CoupledAxis, ...] = ()
    group: str = "R1"
    rate: Annotated[float, Field(ge=1, le=100)] = 20.0
    io: Annotated[tuple[Annotated[int, Field(ge=1, le=9999, strict=True)], ...], Field(max_length=16)] = (
        1,
        1001,
    )
    motion: StrictBool = False

    @field_validator("group")
    @classmethod
    def _group(cls, group: str) -> str:
        try:
            instance_of(group)
        except GatewaySettingsError as error:
            raise ValueError(str(error)) from None
        return group

    def arm(self, robot: Declared) -> str:
        """Return the control group."""
        return self.group

    def simulated_options(self, robot: Declared, joint_types: Sequence[JointType]) -> YaskawaSettings:
        """Return the driver's settings, with the factors of a simulated controller."""
        return with_factors(self.options(robot), len(joint_types))

    def options(self, robot: Declared) -> YaskawaSettings:
        """Return the driver's settings."""
        return self.settings

    @property
    def settings(self) -> YaskawaSettings:
        """The settings as the driver takes them."""
        return YaskawaSettings(
            pulses_per_degree=self.pulses_per_degree,
            axes=self.axes,
            other_axes=self.other_axes,
            zero=self.zero,
            coupling=[Coupling(**each.model_dump()) for each in self.coupling],
            group=self.group,
            rate_hz=self.rate,
            io=self.io,
            motion=self.motion,
        )
