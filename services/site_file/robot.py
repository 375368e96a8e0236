"""The site file's `[[robot]]`."""

from datetime import date
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, StrictBool, field_validator, model_validator

from protocol_gateway.core.codes import code_table
from protocol_gateway.drivers.driver import Recovery
from protocol_gateway.drivers.fanuc.axes import FanucSettings
from protocol_gateway.drivers.opcua.settings import OpcUaSettings
from protocol_gateway.drivers.registry import OWN, is_known, protocols
from protocol_gateway.drivers.universal_robots.settings import UniversalRobotsSettings
from protocol_gateway.drivers.yaskawa.axes import YaskawaSettings
from protocol_gateway.errors import CodeTableError
from protocol_gateway.proofs import StopProof
from robomesh import keys
from robomesh.access_rights import PROBE_ROBOT
from robomesh.errors import KeyNameError
from robots.description import Pose
from robots.schema import JointSettings, Model, Positive, Range, StatedModel
from robots.verification_record import VerificationRecord, read_record
from services.errors import ListenError
from services.site_file.fanuc import FTP_RATE, Fanuc
from services.site_file.fixtures import Clearance, Floor
from services.site_file.legacy_clients import LegacyClients
from services.site_file.listen_address import is_loopback, split_address
from services.site_file.opcua import OpcUa
from services.site_file.part import PART_CONFIG
from services.site_file.universal_robots import UniversalRobots
from services.site_file.yaskawa import Yaskawa


class StopTrial(BaseModel):
    """A trial of the stop on the real controller.

    Attributes:
        driver: The robot's protocol.
        means: How the stop was sent; the page of the protocol has the words.
        software: Version of the controller's software, as `robomesh list --json` shows it.
        date: Day of the trial.
    """

    model_config = PART_CONFIG
    driver: str
    means: str
    software: str
    date: date


class Robot(BaseModel):
    """An arm and its controller.

    Attributes:
        name: Name in keys: lower-case letters, digits, `-` and `_`, at most 64 characters.
        model: A robot of the library or of the example robots by its name, or the path of a `robot.toml` or a
            URDF.
        pose: Pose of its base in the site's frame.
        cell: Name of its cell; empty: alone in its cell. Robots of one cell are checked against each other.
        controller: `simulated`: `robomesh up` starts a simulator; otherwise `tcp://HOST:PORT`, or
            `udp://HOST:PORT` with the protocol `hses`.
        ports: Ports of the controller's other interfaces, where they are not the usual ones, as in
            `{ primary = 30011 }`.
        protocol: The controller's protocol: `unit` (docs/controllers.md), `rtde` for a controller of
            Universal Robots (docs/controllers/universal-robots.md), `hses` for one of Yaskawa
            (docs/controllers/yaskawa.md), `snpx` for one of FANUC (docs/controllers/fanuc.md),
            `fanuc-ftp` to read one without SNPX once a second, `opcua` to read an OPC UA server
            (docs/controllers/opcua.md), or that of an installed driver (docs/controllers/own-driver.md).
        universal_robots: Motion of a robot of Universal Robots; with the protocol `rtde`.
        yaskawa: Properties of the robot that a Yaskawa controller does not report; with the protocol `hses`.
        fanuc: Properties of the robot that a FANUC controller does not report; with the protocols `snpx`
            and `fanuc-ftp`.
        opcua: The OPC UA server, and what is read from it; with the protocol `opcua`.
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
            `true` with the protocol `unit`; with others what was tried, as in `{ driver = "rtde",
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
            twice this time, at least 4 s. Absent: 1 s, with the protocol `fanuc-ftp` the time of three
            positions.
        demo: The simulator moves the arm until the first command.
        legacy_clients: Address for programs that use the unit protocol; absent: they cannot connect.
    """

    model_config = PART_CONFIG
    name: str
    model: str
    pose: Pose = Pose()
    cell: str = ""
    controller: str = "simulated"
    ports: dict[str, Annotated[int, Field(gt=0, lt=65536)]] = Field(default_factory=dict)
    protocol: str = "unit"
    universal_robots: UniversalRobots | None = None
    yaskawa: Yaskawa | None = None
    fanuc: Fanuc | None = None
    opcua: OpcUa | None = None
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
                '{ driver = "rtde", means = "...", software = "5.12.4", date = 2026-11-26 }'
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
        hses = self.protocol == "hses"
        if self.driver and self.protocol in OWN:
            raise ValueError(
                f"driver needs the protocol of an installed driver, this robot's is {self.protocol!r}"
            )
        if self.simulated and self.protocol not in OWN:
            raise ValueError(f"controller: protocol {self.protocol!r} has no simulator: name its address")
        for part, of_part in (
            ("universal_robots", ("rtde",)),
            ("yaskawa", ("hses",)),
            ("fanuc", ("snpx", "fanuc-ftp")),
            ("opcua", ("opcua",)),
        ):
            if getattr(self, part) is not None and self.protocol not in of_part:
                needed = " or ".join(map(repr, of_part))
                raise ValueError(f"{part} needs the protocol {needed}, this robot's is {self.protocol!r}")
        if self.protocol == "fanuc-ftp":
            (self.fanuc or Fanuc()).check_ftp(self.stale_after_s)
        elif self.fanuc is not None:
            self.fanuc.check_snpx()
        if self.protocol == "opcua" and not self.simulated:
            host, _ = split_address(self.address)
            (self.opcua or OpcUa()).check(loopback=is_loopback(host))
        if self.protocol not in OWN:
            return self
        if not self.simulated and self.controller.startswith("udp://") is not hses:
            raise ValueError(
                f"controller {self.controller}: protocol {self.protocol!r} needs "
                f"{'udp' if hses else 'tcp'}://{self.address}"
            )
        return self

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
        if self.protocol in ("snpx", "fanuc-ftp"):
            return f"G{(self.fanuc or Fanuc()).group}"
        if self.protocol == "opcua":
            return (self.opcua or OpcUa()).device
        return (self.yaskawa or Yaskawa()).group if self.protocol == "hses" else ""

    @property
    def options(
        self,
    ) -> YaskawaSettings | FanucSettings | OpcUaSettings | UniversalRobotsSettings | dict[str, Any] | None:
        """Settings of the protocol's driver, which the gateway passes on; None: it has none."""
        match self.protocol:
            case "hses":
                return (self.yaskawa or Yaskawa()).settings
            case "snpx":
                return (self.fanuc or Fanuc()).settings
            case "fanuc-ftp":
                return (self.fanuc or Fanuc()).ftp_settings
            case "opcua":
                return (self.opcua or OpcUa()).settings(simulated=self.simulated)
            case "rtde":
                return (self.universal_robots or UniversalRobots()).settings
            case _:
                return self.driver or None

    @property
    def simulated(self) -> bool:
        """True if the controller is the simulator."""
        return self.controller == "simulated"

    @property
    def stale_time_s(self) -> float:
        """The stale time [s]: as declared, or the protocol's."""
        if self.stale_after_s is not None:
            return self.stale_after_s
        if self.protocol == "fanuc-ftp":
            return 3.0 / ((self.fanuc or Fanuc()).rate or FTP_RATE)
        return 1.0

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
