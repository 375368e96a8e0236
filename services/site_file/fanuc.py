"""The site file's part on a robot of FANUC."""

from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, Field, StrictBool, field_validator, model_validator

from protocol_gateway.drivers.fanuc.assignments import (
    MOST_GROUPS,
    MOST_REGISTER,
    MOST_REGISTERS,
    MOST_TOOLS,
)
from protocol_gateway.drivers.fanuc.axes import FanucSettings, signal_bits
from protocol_gateway.drivers.fanuc.data import AXES
from protocol_gateway.errors import GatewaySettingsError
from services.site_file.part import PART_CONFIG

_Axis: TypeAlias = Annotated[int, Field(ge=1, le=AXES, strict=True)]
_Tool: TypeAlias = Annotated[int, Field(ge=1, le=MOST_TOOLS, strict=True)]
_Register: TypeAlias = Annotated[int, Field(ge=1, le=MOST_REGISTER, strict=True)]


class Fanuc(BaseModel):
    """Properties of a robot that its FANUC controller does not report (docs/controllers/fanuc.md).

    Attributes:
        assignments: `own`: the gateway assigns values to the words that it reads, for its connection. Permit
            this only if the controller keeps a table for each connection; otherwise it clears the table of
            all clients. `pendant`: an operator has entered the assignments. Absent: the joints are not shown.
        j23: Factor of axis 2 in the angle of joint 3: 1 if axis 3 is measured against the horizontal, as in
            most arms; 0 if it is measured against link 2; -1. Absent: the joints are not shown.
        axes: Number of each joint's axis in the controller's order, from 1; empty: 1, 2, 3, ...
        other_axes: Numbers of axes of the group that are no joints of the model, and neither carry nor move
            the arm, as a servo gun's. With other axes than these the robot is read-only.
        reversed: Numbers of the joints, from 1, that turn the other way than the controller's axes.
        zero: Position of each joint where its axis is at 0 [deg], or [mm]; empty: 0.
        group: Motion group, 1 to 8.
        rate: Positions a second.
        tools: Numbers of the tools with a frame to read.
        registers: Numbers of the registers R[] to read twice a second.
        io: Inputs and outputs to read twice a second: `DI[1-16]`; DO, RI, RO, UI and UO likewise; at most 16.
        motion: The gateway moves the robot by RMI (option R912), experimental; otherwise it only reads, and
            sends nothing to RMI.
        speed: Speed of a motion at 100 %, in percent of the arm's greatest; the override slows it further.
    """

    model_config = PART_CONFIG
    assignments: Literal["own", "pendant"] | None = None
    j23: Literal[-1, 0, 1] | None = None
    axes: tuple[_Axis, ...] = ()
    other_axes: tuple[_Axis, ...] = ()
    reversed: tuple[_Axis, ...] = ()
    zero: tuple[float, ...] = ()
    group: Annotated[int, Field(ge=1, le=MOST_GROUPS, strict=True)] = 1
    rate: Annotated[float, Field(ge=1, le=100)] = 20.0
    tools: Annotated[tuple[_Tool, ...], Field(max_length=MOST_TOOLS)] = (1,)
    registers: Annotated[tuple[_Register, ...], Field(max_length=MOST_REGISTERS)] = ()
    io: Annotated[tuple[str, ...], Field(max_length=16)] = ("DI[1-16]", "DO[1-16]", "RI[1-8]", "RO[1-8]")
    motion: StrictBool = False
    speed: Annotated[float, Field(ge=1, le=100)] = 20.0

    @field_validator("io")
    @classmethod
    def _io(cls, io: tuple[str, ...]) -> tuple[str, ...]:
        try:
            for each in io:
                signal_bits(each)
        except GatewaySettingsError as error:
            raise ValueError(str(error)) from None
        return io

    @model_validator(mode="after")
    def _of_table(self) -> "Fanuc":
        try:
            assert self.settings.table
            if (problem := self.settings.motion_problem if self.motion else None) is not None:
                raise GatewaySettingsError(problem)
        except GatewaySettingsError as error:
            raise ValueError(str(error)) from None
        return self

    @property
    def settings(self) -> FanucSettings:
        """The settings as the driver takes them."""
        values = self.model_dump()
        return FanucSettings(rate_hz=values.pop("rate"), speed_percent=values.pop("speed"), **values)
