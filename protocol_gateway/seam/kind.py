"""A kind of controller: what an entry point of the group `robomesh.drivers` gives."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Protocol, cast

from protocol_gateway.seam.protocol import Driver
from protocol_gateway.seam.table import Table
from robots.schema.robot_toml import JointType


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


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of controller. Its parts are named as `module:name`, because every process reads a site file.

    Attributes:
        driver: `DriverMaker` of its drivers, or the name of one.
        key: Key of a robot's table in the site file; empty: there is none. For a package the key is always
            "driver".
        table: Name of the table's model, a `Table`; empty: the table is passed on unchanged.
        datagrams: The site file's `controller` is udp://HOST:PORT, otherwise tcp://HOST:PORT; None: either.
        extra: Extra of the distribution that brings what it needs; empty: it needs no more.
        packages: Modules that the extra brings.
        certificate: Name of the function behind `robomesh keys KEY FILE.pem`, which makes the gateway's own
            certificate for a lifetime and returns lines to print; empty: none is needed. Of robomesh's own
            kinds only.
        probe: Name of its `controllers.probing.Probe`; empty: `robomesh probe` does not know it.
        simulated: Name of its `Simulated` controller (`protocol_gateway.seam.simulated`); empty: it has none.
        distribution: Name of the package that gives it; robomesh sets it.
    """

    driver: DriverMaker | str
    key: str = "driver"
    table: str = ""
    datagrams: bool | None = False
    extra: str = ""
    packages: tuple[str, ...] = ()
    certificate: str = ""
    probe: str = ""
    simulated: str = ""
    distribution: str = "robomesh"

    @property
    def driver_maker(self) -> DriverMaker:
        """The factory of its drivers; the import may fail."""
        return cast("DriverMaker", named(self.driver)) if isinstance(self.driver, str) else self.driver

    @property
    def table_model(self) -> type[Table] | None:
        """Model of its table; None: it has none."""
        return cast("type[Table]", named(self.table)) if self.table else None


def named(name: str) -> object:
    """Return what `module:name` names."""
    module, _, attribute = name.partition(":")
    return getattr(import_module(module), attribute)
