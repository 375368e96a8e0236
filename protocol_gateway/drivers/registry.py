"""Registry of protocols. A new protocol needs one file, and a line here."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Any, Protocol

from protocol_gateway.drivers.driver import Driver
from protocol_gateway.drivers.fanuc.driver import SnpxDriver
from protocol_gateway.drivers.opcua.driver import OpcUaDriver
from protocol_gateway.drivers.unit import UnitDriver
from protocol_gateway.drivers.universal_robots.driver import RtdeDriver
from protocol_gateway.drivers.universal_robots.motion_driver import RtdeMotionDriver
from protocol_gateway.drivers.yaskawa.driver import HsesDriver
from robots.joints import JointType


class DriverMaker(Protocol):
    """Factory of a robot's driver, usually the driver's class."""

    def __call__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None,
        options: object,
    ) -> Driver:
        """Create a driver.

        Args:
            joint_types: Types of the joints, in the order of the controller's values.
            codes: The site file's table of type codes; empty if there is none.
            relay: Callback with units for old client programs, see `UnitDriver`; None: there are none.
            options: What the site file declares for this kind of controller; None: nothing.

        Raises:
            ProtocolGatewayError: If the arguments are invalid.
        """
        ...


def _rtde(joint_types: Sequence[JointType], codes: Mapping[int, str], **given: Any) -> Driver:
    """Create the driver that only reads, unless the site file declares motion."""
    kind = RtdeDriver if given["options"] is None else RtdeMotionDriver
    return kind(joint_types, codes, **given)


DRIVERS: dict[str, DriverMaker] = {
    "unit": UnitDriver,
    "rtde": _rtde,
    "hses": HsesDriver,
    "snpx": SnpxDriver,
    "opcua": OpcUaDriver,
}
"""Driver factories by the site file's `protocol`."""
