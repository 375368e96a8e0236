"""Properties of an OPC UA server that the site file declares."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class OpcUaJoint:
    """Source of a joint's position.

    Attributes:
        axis: BrowseName of an axis of OPC 40010-1; empty: `node` is given.
        node: NodeId of a variable: "nsu=URI;s=NAME" or "ns=2;s=NAME"; empty: `axis` is given.
        unit: "deg", "rad", "mm" or "m"; empty: the server's EngineeringUnits.
        reversed: The model's joint turns the other way.
        zero: Position of the joint where the server reports 0 [degree] or [mm].
    """

    axis: str = ""
    node: str = ""
    unit: str = ""
    reversed: bool = False
    zero: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class OpcUaSignal:
    """Source of a signal.

    Attributes:
        name: Name of the signal, as in docs/signals.md.
        node: NodeId of a variable.
        unit: Unit as it is shown; empty: the server's, or none.
    """

    name: str
    node: str
    unit: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class OpcUaSettings:
    """Properties of an OPC UA server that the site file declares.

    Attributes:
        security: "sign_and_encrypt" or "none".
        server_certificate: SHA-256 fingerprint of the server's certificate, 64 hexadecimal digits; empty with
            security "none".
        certificate: PEM file with our own certificate and its private key; empty with security "none".
        user: Name of the server's user; empty: anonymous.
        password_file: File with the user's password, which only its owner may read.
        path: Path of the server's address, after HOST:PORT; empty: it has none.
        rate_hz: Samples of positions a second.
        device: BrowseName of the motion device; empty: the server has one.
        joints: One a joint of the model; empty: the axes of the motion device, in the order of their names.
        signals: Further variables.
    """

    security: str = "sign_and_encrypt"
    server_certificate: str = ""
    certificate: str = ""
    user: str = ""
    password_file: str = ""
    path: str = ""
    rate_hz: float = 20.0
    device: str = ""
    joints: Sequence[OpcUaJoint] = ()
    signals: Sequence[OpcUaSignal] = ()


def to_text(settings: OpcUaSettings) -> str:
    """Return the settings as an argument of the reading process."""
    return json.dumps(asdict(settings), separators=(",", ":"))


def from_text(text: str) -> OpcUaSettings:
    """Return the settings from `to_text`."""
    values = json.loads(text)
    values["joints"] = [OpcUaJoint(**each) for each in values["joints"]]
    values["signals"] = [OpcUaSignal(**each) for each in values["signals"]]
    return OpcUaSettings(**values)
