"""The site file's part on a robot of FANUC."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, StrictBool, field_validator, model_validator

from controllers.fanuc.assignments import (
    MOST_GROUPS,
    MOST_REGISTER,
    MOST_REGISTERS,
    MOST_TOOLS,
)
from controllers.fanuc.axes import ANONYMOUS, FanucSettings, signal_bits, with_defaults
from controllers.fanuc.data import AXES
from protocol_gateway.seam.errors import GatewaySettingsError
from protocol_gateway.seam.table import Declared, Table
from robots.kinematics.joints import JointType

_FTP = "fanuc-ftp"
# Positions a second, unless the site file says otherwise.
_RATE, _FTP_RATE, _MOST_FTP_RATE = 20.0, 1.0, 2.0
_Axis: TypeAlias = Annotated[int, Field(ge=1, le=AXES, strict=True)]
_Tool: TypeAlias = Annotated[int, Field(ge=1, le=MOST_TOOLS, strict=True)]
_Register: TypeAlias = Annotated[int, Field(ge=1, le=MOST_REGISTER, strict=True)]


class Fanuc(Table):
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
        rate: Positions a second; absent: 20, with the protocol `fanuc-ftp` 1, and there at most 2.
        tools: Numbers of the tools with a frame to read.
        registers: Numbers of the registers R[] to read twice a second, with `fanuc-ftp` every 5 s.
        io: Inputs and outputs to read twice a second, with `fanuc-ftp` every 2 s: `DI[1-16]`; DO, RI, RO, UI
            and UO likewise; at most 16.
        motion: The gateway moves the robot by RMI (option R912), experimental; otherwise it only reads, and
            sends nothing to RMI.
        speed: Speed of a motion at 100 %, in percent of the arm's greatest; the override slows it further.
        user: User of the FTP server, with `fanuc-ftp`; absent: anonymous. FTP sends name and password
            unencrypted.
        password_file: File with that user's password, which only its owner may read.
    """

    assignments: Literal["own", "pendant"] | None = None
    j23: Literal[-1, 0, 1] | None = None
    axes: tuple[_Axis, ...] = ()
    other_axes: tuple[_Axis, ...] = ()
    reversed: tuple[_Axis, ...] = ()
    zero: tuple[float, ...] = ()
    group: Annotated[int, Field(ge=1, le=MOST_GROUPS, strict=True)] = 1
    rate: Annotated[float, Field(ge=0.2, le=100)] | None = None
    tools: Annotated[tuple[_Tool, ...], Field(max_length=MOST_TOOLS)] = (1,)
    registers: Annotated[tuple[_Register, ...], Field(max_length=MOST_REGISTERS)] = ()
    io: Annotated[tuple[str, ...], Field(max_length=16)] = ("DI[1-16]", "DO[1-16]", "RI[1-8]", "RO[1-8]")
    motion: StrictBool = False
    speed: Annotated[float, Field(ge=1, le=100)] = 20.0
    user: Annotated[str, Field(max_length=100, pattern=r"^[!-~]*$")] = ""
    password_file: Path | None = None

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
            settings = self._settings(_RATE)
            assert settings.table
            if (problem := settings.motion_problem if self.motion else None) is not None:
                raise GatewaySettingsError(problem)
        except GatewaySettingsError as error:
            raise ValueError(str(error)) from None
        return self

    def arm(self, robot: Declared) -> str:
        """Return the motion group."""
        return f"G{self.group}"

    def stale_time_s(self, robot: Declared) -> float:
        """Return the time of three positions by FTP, and otherwise the usual one [s]."""
        return 3.0 / (self.rate or _FTP_RATE) if robot.protocol == _FTP else super().stale_time_s(robot)

    def simulated_options(self, robot: Declared, joint_types: Sequence[JointType]) -> FanucSettings:
        """Return the driver's settings, with what a simulated controller adds."""
        return with_defaults(self.options(robot), tuple(joint_types))

    def options(self, robot: Declared) -> FanucSettings:
        """Return the driver's settings."""
        return self._settings(_FTP_RATE if robot.protocol == _FTP else _RATE)

    def _settings(self, usual_hz: float) -> FanucSettings:
        values = self.model_dump()
        rate_hz, password = values.pop("rate") or usual_hz, values.pop("password_file")
        return FanucSettings(
            rate_hz=rate_hz,
            speed_percent=values.pop("speed"),
            user=values.pop("user") or ANONYMOUS,
            password_file="" if password is None else str(password),
            **values,
        )

    def check(self, robot: Declared) -> None:
        """Check the table with the protocol.

        Raises:
            ValueError: If a key does not belong to it, or the stale time is too short for the rate.
        """
        if robot.protocol == _FTP:
            self._check_ftp(robot.stale_after_s)
            return
        for key in ("user", "password_file"):
            if key in self.model_fields_set:
                raise ValueError(f"fanuc.{key} needs the protocol 'fanuc-ftp', this robot's is 'snpx'")
        if self.rate is not None and self.rate < 1.0:
            raise ValueError(f"fanuc.rate {self.rate:g}: must be 1 to 100 with the protocol 'snpx'")

    def _check_ftp(self, stale_after_s: float | None) -> None:
        for key in ("assignments", "motion", "speed"):
            if key in self.model_fields_set:
                raise ValueError(f"fanuc.{key} needs the protocol 'snpx', this robot's is 'fanuc-ftp'")
        if self.password_file is not None and not self.user:
            raise ValueError("fanuc.password_file needs user")
        rate = self.rate or _FTP_RATE
        if rate > _MOST_FTP_RATE:
            raise ValueError(
                f"fanuc.rate {rate:g}: with the protocol 'fanuc-ftp' at most {_MOST_FTP_RATE:g}, because the "
                "controller writes a file for each position"
            )
        if stale_after_s is not None and stale_after_s < 2.0 / rate:
            raise ValueError(
                f"stale_after_s {stale_after_s:g}: must be {2.0 / rate:g} or more with {rate:g} positions a "
                "second; otherwise the joints are stale between two of them"
            )

    def in_folder(self, folder: Path) -> "Fanuc":
        """Return the part with the path of its file relative to a folder."""
        if self.password_file is None:
            return self
        return self.model_copy(update={"password_file": folder / self.password_file})
