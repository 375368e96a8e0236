"""The site file's `[[robot]]`."""

from collections.abc import Mapping
from datetime import date
from functools import cache
from inspect import cleandoc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from pydantic import (
    Field,
    StrictBool,
    ValidationError,
    create_model,
    field_validator,
    model_validator,
)

from protocol_gateway.configuration.controller_proofs import StopProof
from protocol_gateway.configuration.kinds import is_known, kind_of, own_kinds, protocols
from protocol_gateway.seam import Recovery
from protocol_gateway.seam.errors import CodeTableError, GatewaySettingsError
from protocol_gateway.seam.kind import Kind
from protocol_gateway.seam.table import Declared, Table, problem_text
from protocol_gateway.unit_protocol.codes import code_table
from robomesh.contract import keys
from robomesh.contract.access_rights import PROBE_ROBOT
from robomesh.errors import KeyNameError, ListenError
from robomesh.listen_address import is_loopback, split_address
from robots.descriptions.description import Pose, load
from robots.kinematics.joints import joints_of
from robots.kinematics.verification_record import VerificationRecord, read_record
from robots.schema.robot_toml import JointSettings, Model, Positive, Range, StatedModel
from robots.schema.toml_table import TomlTable
from services.site_file.tables.fixtures import Clearance, Floor
from services.site_file.tables.legacy_clients import LegacyClients


class StopTrial(TomlTable):
    """A trial of the stop on the real controller.

    Attributes:
        driver: The robot's protocol.
        means: How the stop was sent; the page of the protocol has the words.
        software: Version of the controller's software, as `robomesh list --json` shows it.
        date: Day of the trial.
    """

    driver: str
    means: str
    software: str
    date: date


class Robot(TomlTable):
    """An arm and its controller.

    Attributes:
        name: Name in keys: lower-case letters, digits, `-` and `_`, at most 64 characters.
        model: A robot of the library or of the example robots by its name, or the path of a `robot.toml` or a
            URDF.
        pose: Pose of its base in the site's frame.
        cell: Name of its cell; empty: alone in its cell. Robots of one cell are checked against each other.
        controller: `simulated`: `robomesh up` starts a simulator; otherwise `tcp://HOST:PORT`, or
            `udp://HOST:PORT` if the protocol uses datagrams.
        ports: Ports of the controller's other interfaces, where they are not the usual ones, as in
            `{ primary = 30011 }`.
        protocol: The controller's protocol: `unit`, that of a vendor (docs/controllers.md lists them), or
            that of an installed driver (docs/controllers/own-driver.md).
        driver: Settings of an installed driver (docs/controllers/own-driver.md), which it gets unchanged.
        codes: Type codes of a controller that sends numbers, as in
            `{ 2 = "ABSOLUTE.DEG", 101 = "COMMAND:home" }`; they replace the default codes. Empty: the gateway
            sends types as names.
        accept_unknown: States that the controller never reports; the gateway sends commands although they are
            unknown.
        check: The check of each motion for collisions: `require` refuses a motion that fails it or cannot
            be checked, `warn` reports it, `off` checks nothing.
        check_within_s: Longest check of a motion [s]; at most 80 % of the time until the command's deadline,
            or 0.8 s without one. Absent: ten times the slowest of the last checks, between 2 and 5 s.
        jog_speed: The tool's greatest speed [mm/s] while an operator holds a button to jog it; 0: no jogs.
        clearance: Distances to fixtures and other robots.
        limits: Lowest and highest position of joints of a URDF (degrees or mm), as in `{ j1 = [-170, 170] }`.
            Needed where those of the URDF are doubtful; otherwise they must be within the URDF's.
        max_speed: Highest speed of joints of a URDF (degrees/s or mm/s), as in `{ j1 = 180 }`.
        floor: The floor of its cell: its height [mm], a table, or `false` for none. In a cell of several
            robots one robot's key applies to all.
        stop_proven: The stop was tried on this controller (docs/safety.md); otherwise the robot is read-only.
            `true` with the protocol `unit`; with others what was tried, as in `{ driver = "...",
            means = "...", software = "5.12.4", date = 2026-11-26 }`. Absent: `true` for a simulated
            controller, else `false`.
        verified: File of `robomesh robot verify --out`: the model's joints were compared with this
            controller's. Without it, the joints of a controller that reports its tool's pose are shown as
            unproven, and count for no check.
        experimental: Send commands although this protocol's were never tried on a real controller.
        recover: Actions that an operator may send after a stop or fault of the controller's own, as in
            `["unlock_protective_stop", "power_on"]` (docs/safety.md#recovery). `servo_on` and `reset_alarm`
            are for installed drivers: no driver of robomesh has them.
        stale_after_s: The stale time [s]: without a unit of the controller for this long, the robot's state
            is stale; without joint positions for this long, the gateway refuses motion. It reconnects after
            twice this time, at least 4 s. Absent: 1 s, or the time of three positions where they are rarer.
        thin_at_rest: Publish ten joint states a second of the arm at rest, and all as soon as it moves
            (docs/recordings.md). `false`: always all.
        demo: The simulator moves the arm until the first command.
        legacy_clients: Address for programs that use the unit protocol; absent: they cannot connect.
    """

    name: str
    model: str
    pose: Pose = Pose()
    cell: str = ""
    controller: str = "simulated"
    ports: dict[str, Annotated[int, Field(gt=0, lt=65536)]] = Field(default_factory=dict)
    protocol: str = "unit"
    driver: dict[str, Any] = Field(default_factory=dict)
    codes: dict[int, str] = Field(default_factory=dict)
    accept_unknown: tuple[Literal["mode", "homed"], ...] = ()
    check: Literal["require", "warn", "off"] = "warn"
    check_within_s: Annotated[float, Field(gt=0, le=5)] | None = None
    jog_speed: Annotated[float, Field(ge=0, le=250)] = 250.0
    clearance: Clearance = Clearance()
    floor: Floor | None = Floor()
    limits: dict[str, Range] = Field(default_factory=dict)
    max_speed: dict[str, Positive] = Field(default_factory=dict)
    stop_proven: StrictBool | StopTrial | None = None
    verified: Path | None = None
    experimental: StrictBool = False
    recover: tuple[Recovery, ...] = ()
    stale_after_s: Annotated[float, Field(gt=0.05, le=60)] | None = None
    thin_at_rest: StrictBool = True
    demo: StrictBool = False
    legacy_clients: LegacyClients | None = None

    @field_validator("name")
    @classmethod
    def _name(cls, name: str) -> str:
        if keys.is_replay(name):
            raise ValueError('names that begin with "replay-" are reserved for replays: choose another name')
        if name == PROBE_ROBOT:
            raise ValueError("this name is reserved for testing rights: choose another name")
        try:
            return keys.check_name(name, "robot")
        except KeyNameError as error:
            raise ValueError(str(error)) from None

    @field_validator("stop_proven", mode="before")
    @classmethod
    def _stop_proven(cls, proven: Any) -> Any:
        if not isinstance(proven, bool | dict | StopTrial | None):
            raise ValueError(
                "should be true, false, or what was tried, as in "
                '{ driver = "...", means = "...", software = "5.12.4", date = 2026-11-26 }'
            )
        return proven

    @field_validator("recover", mode="before")
    @classmethod
    def _recover(cls, names: Any) -> Any:
        known = [each.value for each in Recovery]
        names = names if isinstance(names, list | tuple) else [names]
        if wrong := [name for name in names if name not in known]:
            raise ValueError(f"{wrong[0]!r} is none of {', '.join(map(repr, known))}")
        return names

    @field_validator("protocol")
    @classmethod
    def _protocol(cls, protocol: str) -> str:
        if not is_known(protocol):
            raise ValueError(f"should be {' or '.join(map(repr, protocols()))}")
        return protocol

    @field_validator("floor", mode="before")
    @classmethod
    def _floor(cls, floor: Any) -> Any:
        if floor is False:
            return None
        if isinstance(floor, dict | Floor):
            return floor
        if isinstance(floor, bool) or not isinstance(floor, int | float):
            raise ValueError(
                "should be its height in mm, false, or a table as { height = -250.0, warning = 50.0 }"
            )
        return {"height": floor}

    @field_validator("codes", mode="before")
    @classmethod
    def _codes(cls, codes: Any) -> Any:
        if not isinstance(codes, dict):
            return codes
        try:
            # TOML keys are strings.
            return {int(code): meaning for code, meaning in codes.items()}
        except ValueError:
            raise ValueError('a code is a number, as in { 2 = "ABSOLUTE.DEG" }') from None

    @field_validator("codes")
    @classmethod
    def _table(cls, codes: dict[int, str]) -> dict[int, str]:
        try:
            code_table(codes)
        except CodeTableError as error:
            raise ValueError(str(error)) from None
        return codes

    @field_validator("controller")
    @classmethod
    def _controller(cls, controller: str) -> str:
        if controller == "simulated":
            return controller
        scheme, _, address = controller.partition("://")
        try:
            _, port = split_address(address)
        except ListenError:
            port = 0
        if scheme not in ("tcp", "udp") or not port:
            raise ValueError("should be 'simulated' or tcp://HOST:PORT, as in tcp://10.0.0.7:5400")
        return controller

    @model_validator(mode="after")
    def _of_protocol(self) -> "Robot":
        own = own_kinds().get(self.protocol)
        if self.driver and own is not None:
            raise ValueError(
                f"driver needs the protocol of an installed driver, this robot's is {self.protocol!r}"
            )
        for key, of_key in _protocols_by_key().items():
            if getattr(self, key) is not None and self.protocol not in of_key:
                needed = " or ".join(map(repr, of_key))
                raise ValueError(f"{key} needs the protocol {needed}, this robot's is {self.protocol!r}")
        kind = self.kind
        if self.simulated and not kind.simulated:
            try:
                kind_of(self.protocol)
            except GatewaySettingsError as error:
                raise ValueError(str(error)) from None
            raise ValueError(f"controller: protocol {self.protocol!r} has no simulator: name its address")
        if self.table is not None:
            self.table.check(self.declared)
        if kind.datagrams is not None and not self.simulated:
            scheme = "udp" if kind.datagrams else "tcp"
            if not self.controller.startswith(f"{scheme}://"):
                raise ValueError(
                    f"controller {self.controller}: protocol {self.protocol!r} needs "
                    f"{scheme}://{self.address}"
                )
        return self

    @property
    def kind(self) -> Kind:
        """Its kind of controller."""
        try:
            return kind_of(self.protocol)
        except GatewaySettingsError:
            # The gateway says why the package's driver cannot be used.
            return Kind(driver="", datagrams=None)

    @property
    def table(self) -> Table | None:
        """The table of its kind of controller, with defaults where the file has none; None: none is known."""
        kind = self.kind
        if kind.table_model is None:
            return None
        if kind.key == "driver":
            try:
                return kind.table_model.model_validate(self.driver)
            except ValidationError as error:
                problem = error.errors()[0]
                where = ".".join(map(str, ("driver", *problem["loc"])))
                raise ValueError(f"{where}: {problem_text(problem)}") from None
        return cast("Table | None", getattr(self, kind.key)) or kind.table_model()

    @property
    def declared(self) -> Declared:
        """What is declared besides the table."""
        loopback = self.simulated or is_loopback(split_address(self.address)[0])
        return Declared(
            protocol=self.protocol,
            simulated=self.simulated,
            loopback=loopback,
            stale_after_s=self.stale_after_s,
        )

    @property
    def described(self) -> Model:
        """Source of its description, with the limits that this file states."""
        names = (*self.limits, *(name for name in self.max_speed if name not in self.limits))
        rows = tuple(
            JointSettings(name=name, limits=self.limits.get(name), max_speed=self.max_speed.get(name))
            for name in names
        )
        return StatedModel(model=self.model, joints=rows) if rows else self.model

    @property
    def address(self) -> str:
        """HOST:PORT of the controller."""
        return self.controller.partition("://")[2]

    @property
    def group(self) -> str:
        """Control group or device of its controller, where one has several robots; empty: it has one."""
        return "" if self.table is None else self.table.arm(self.declared)

    @property
    def options(self) -> object:
        """Settings of the protocol's driver, which the gateway passes on; None: it has none."""
        return (self.driver or None) if self.table is None else self.table.options(self.declared)

    @property
    def driver_options(self) -> object:
        """Settings of the driver; a simulated controller has its own values, unless declared."""
        if not self.simulated or self.table is None:
            return self.options
        joint_types = joints_of(load(self.model)).types
        return self.table.simulated_options(self.declared, joint_types)

    @property
    def simulated(self) -> bool:
        """True if the controller is the simulator."""
        return self.controller == "simulated"

    @property
    def stale_time_s(self) -> float:
        """The stale time [s]: as declared, or the protocol's."""
        if self.stale_after_s is not None:
            return self.stale_after_s
        return 1.0 if self.table is None else self.table.stale_time_s(self.declared)

    @property
    def proof_of_stop(self) -> StopProof | bool:
        """The trial of the stop; a simulated controller needs none."""
        if isinstance(self.stop_proven, StopTrial):
            return StopProof(**self.stop_proven.model_dump())
        return self.simulated if self.stop_proven is None else self.stop_proven

    @property
    def comparison(self) -> VerificationRecord | None:
        """The comparison of its joints; None: the file names none.

        Raises:
            VerificationRecordError: If the file cannot be used.
        """
        return None if self.verified is None else read_record(self.verified)


@cache
def _protocols_by_key() -> Mapping[str, tuple[str, ...]]:
    """Return the protocols of robomesh by the key of their table."""
    found: dict[str, tuple[str, ...]] = {}
    for protocol, kind in own_kinds().items():
        if kind.table:
            found[kind.key] = (*found.get(kind.key, ()), protocol)
    return found


def _with_tables() -> type[Robot]:
    """Return the model with a key for the table of each of robomesh's own kinds."""
    models = {kind.key: kind.table_model for kind in own_kinds().values() if kind.table_model}
    lines = []
    for key, model in models.items():
        first, _, _ = cleandoc(model.__doc__ or "").partition(".\n")
        names = " or ".join(f"`{each}`" for each in _protocols_by_key()[key])
        lines.append(f"    {key}: {first}; with the protocol {names}.")
    doc = "\n".join((cleandoc(Robot.__doc__ or "").partition("\n")[0], "", "Attributes:", *lines))
    fields: dict[str, Any] = {key: (model | None, None) for key, model in models.items()}
    return create_model("Robot", __base__=Robot, __doc__=doc, __module__=__name__, **fields)


if not TYPE_CHECKING:
    Robot = _with_tables()
