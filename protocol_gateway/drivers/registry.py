"""Which protocols there are. Another one is one more file, and a line here."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from typing import Protocol

from protocol_gateway.drivers.driver import Driver
from protocol_gateway.drivers.unit import UnitDriver
from robots.joints import JointType


class DriverMaker(Protocol):
    """Makes the driver of one robot, usually its class."""

    def __call__(
        self,
        joint_types: Sequence[JointType],
        codes: Mapping[int, str],
        *,
        relay: Callable[[bytes, bool, Hashable], None] | None,
    ) -> Driver:
        """A driver.

        Args:
            joint_types: One a joint, in the order of the controller's numbers.
            codes: The site file's table of type codes; empty where there is none.
            relay: Takes units for old client programs, as `UnitDriver` says; None: there are none.

        Raises:
            ProtocolGatewayError: If it cannot be made of these.
        """
        ...


DRIVERS: dict[str, DriverMaker] = {"unit": UnitDriver}
"""By what the site file's `protocol` says."""
