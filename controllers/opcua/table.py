"""The site file's part on a robot that is read by OPC UA."""

import re
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, StrictBool, field_validator, model_validator

from controllers.opcua.settings import OpcUaJoint, OpcUaSettings, OpcUaSignal
from protocol_gateway.seam import Signal
from protocol_gateway.seam.table import Declared, Table
from robots.schema.toml_table import TomlTable

_NODE = re.compile(r"(nsu=[^;]+;|ns=\d{1,5};)?(i=\d{1,10}|[sgb]=.+)")
_MOST_SIGNALS = 200


def _node(text: str) -> str:
    if not _NODE.fullmatch(text) or len(text) > 500:
        raise ValueError("should be a NodeId, as in ns=2;s=Robot.J1 or nsu=http://maker.example/robot;s=J1")
    return text


class OpcUaJointPart(TomlTable):
    """Source of a joint's position.

    Attributes:
        axis: BrowseName of an axis of OPC 40010-1, as in `Axis_1`; or `node`.
        node: NodeId of a variable with the position, as in `ns=2;s=Robot.J1`, or with the URI of a namespace
            whose number may change: `nsu=http://maker.example/robot;s=J1`.
        unit: Unit of the position: `deg`, `rad`, `mm` or `m`; absent: as the server states it.
        reversed: The model's joint turns the other way.
        zero: Position of the joint [deg], or [mm], where the server reports 0.
    """

    axis: Annotated[str, Field(max_length=200)] = ""
    node: str = ""
    unit: Literal["", "deg", "rad", "mm", "m"] = ""
    reversed: StrictBool = False
    zero: Annotated[float, Field(allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _one_source(self) -> "OpcUaJointPart":
        if bool(self.axis) is bool(self.node):
            raise ValueError('should have either axis or node, as in { axis = "Axis_1" }')
        if self.node:
            _node(self.node)
        return self


class OpcUaSignalPart(TomlTable):
    """Source of one signal.

    Attributes:
        name: Name of the signal (docs/signals.md).
        node: NodeId of a variable.
        unit: Unit as it is shown; absent: as the server states it, in SI.
    """

    name: str
    node: str
    unit: Annotated[str, Field(max_length=16)] = ""

    @field_validator("name")
    @classmethod
    def _name(cls, name: str) -> str:
        return Signal(name).name

    @field_validator("node")
    @classmethod
    def _node(cls, node: str) -> str:
        return _node(node)


class OpcUa(Table):
    """The OPC UA server of a robot (docs/controllers/opcua.md).

    Attributes:
        security: `sign_and_encrypt`, or `none`, which other machines in the network can read and change.
            Absent: `sign_and_encrypt`, of a simulated controller `none`.
        insecure: Allows `security = "none"` beyond this machine.
        server_certificate: SHA-256 fingerprint of the server's certificate, 64 hexadecimal digits.
        certificate: PEM file with the gateway's certificate and private key; `robomesh keys opcua` makes it.
        user: User of the server; absent: anonymous.
        password_file: File with that user's password, which only its owner may read.
        path: Path of the server's address, as in `/robot/server`, where it has one.
        rate: Samples of the axes a second.
        device: BrowseName of the motion device, where the server has several.
        joints: Source of each joint, in the model's order; empty: the server's axes, in the order of their
            names.
        signals: Further variables to show as signals.
    """

    security: Literal["", "sign_and_encrypt", "none"] = ""
    insecure: StrictBool = False
    server_certificate: str = ""
    certificate: Path | None = None
    user: Annotated[str, Field(max_length=200)] = ""
    password_file: Path | None = None
    path: Annotated[str, Field(max_length=200, pattern=r"^[!-~]*$")] = ""
    rate: Annotated[float, Field(ge=1, le=100)] = 20.0
    device: Annotated[str, Field(max_length=200)] = ""
    joints: tuple[OpcUaJointPart, ...] = ()
    signals: Annotated[tuple[OpcUaSignalPart, ...], Field(max_length=_MOST_SIGNALS)] = ()

    @field_validator("server_certificate")
    @classmethod
    def _fingerprint(cls, text: str) -> str:
        digits = text.lower().removeprefix("sha256:").replace(":", "").replace(" ", "")
        if digits and not re.fullmatch(r"[0-9a-f]{64}", digits):
            raise ValueError("should be the SHA-256 fingerprint of the certificate, 64 hexadecimal digits")
        return digits

    @field_validator("joints")
    @classmethod
    def _joints(cls, joints: tuple[OpcUaJointPart, ...]) -> tuple[OpcUaJointPart, ...]:
        sources = [each.axis or each.node for each in joints]
        for source in sources:
            if sources.count(source) > 1:
                raise ValueError(f"{source} is given for two joints")
        return joints

    @field_validator("signals")
    @classmethod
    def _signals(cls, signals: tuple[OpcUaSignalPart, ...]) -> tuple[OpcUaSignalPart, ...]:
        names = [each.name for each in signals]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two signals are named {name}")
        return signals

    @model_validator(mode="after")
    def _user(self) -> "OpcUa":
        if bool(self.user) is not (self.password_file is not None):
            raise ValueError("user and password_file need each other")
        if self.user and self.security == "none":
            raise ValueError('user: a password is not sent with security = "none"')
        return self

    def check(self, robot: Declared) -> None:
        """Check the security for a controller that is not simulated.

        Raises:
            ValueError: If it is incomplete, or missing beyond this machine.
        """
        if robot.simulated:
            return
        if self.security == "none":
            if not robot.loopback and not self.insecure:
                raise ValueError(
                    'opcua: security = "none" beyond this machine needs insecure = true: other machines of '
                    "the network can read and change the values"
                )
            return
        for key in ("server_certificate", "certificate"):
            if not getattr(self, key):
                raise ValueError(
                    f"opcua.{key} is missing: docs/controllers/opcua.md says how to get it, or write "
                    'security = "none"'
                )

    def in_folder(self, folder: Path) -> "OpcUa":
        """Return the part with the paths of its files relative to a folder."""
        files = {"certificate": self.certificate, "password_file": self.password_file}
        return self.model_copy(update={key: folder / file for key, file in files.items() if file is not None})

    def arm(self, robot: Declared) -> str:
        """Return the motion device."""
        return self.device

    def options(self, robot: Declared) -> OpcUaSettings:
        """Return the driver's settings."""
        security = self.security or ("none" if robot.simulated else "sign_and_encrypt")
        return OpcUaSettings(
            security=security,
            server_certificate=self.server_certificate,
            certificate=_text(self.certificate),
            user=self.user,
            password_file=_text(self.password_file),
            path=self.path,
            rate_hz=self.rate,
            device=self.device,
            joints=[OpcUaJoint(**each.model_dump()) for each in self.joints],
            signals=[OpcUaSignal(**each.model_dump()) for each in self.signals],
        )


def _text(path: Path | None) -> str:
    return "" if path is None else str(path)
