"""The start of the simulated controller."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

from protocol_gateway.seam.simulated import Common, Option, Run, Simulated, Started
from protocol_gateway.seam.table import Table
from robomesh.listen_address import split_address

if TYPE_CHECKING:
    from controllers.universal_robots.simulated.service import UrPorts, UrSettings

_PORT = 30004
_INTERFACES = ("primary", "scripts", "dashboard")


def _address(default: str, text: str) -> Option:
    return Option(metavar="HOST:PORT", help=text, default=f"as --listen, {default}")


def _prepare(
    common: Common,
    *,
    primary: Annotated[str, _address("port 30011", "The primary interface for reading")] = "",
    scripts: Annotated[
        Sequence[str], _address("ports 30001, 30002, 30003", "An interface that takes scripts")
    ] = (),
    dashboard: Annotated[str, _address("port 29999", "The dashboard server")] = "",
) -> Run:
    from controllers.universal_robots.simulated.service import UrSettings, serve_rtde

    host, port = split_address(common["listen"])

    def address(real: int) -> str:
        # A second controller has an address of its own, or free ports.
        return f"{host}:{real if port == _PORT else 0}"

    settings = UrSettings(
        **common,
        primary=primary or address(30011),
        scripts=tuple(scripts or map(address, (30001, 30002, 30003))),
        dashboard=dashboard or address(29999),
    )
    return lambda tell: serve_rtde(settings, ready=lambda ports: tell(_line(settings, host, ports)))


def _line(settings: "UrSettings", host: str, ports: "UrPorts") -> str:
    def at(text: str, *numbers: int) -> str:
        return f"{split_address(text)[0]}:{', '.join(map(str, numbers))}"

    return (
        f"listening on {host}:{ports.rtde}, primary interface on {at(settings.primary, ports.primary)}, "
        f"scripts on {at(settings.scripts[0], *ports.scripts)}, "
        f"dashboard on {at(settings.dashboard, ports.dashboard)}"
    )


def _started(table: Table | None, free_port: Callable[[], int]) -> Started:
    ports = tuple((name, free_port()) for name in _INTERFACES)
    return Started(tuple(word for name, at in ports for word in (f"--{name}", f"127.0.0.1:{at}")), ports)


RTDE = Simulated(
    text="RTDE, scripts and the dashboard of Universal Robots",
    listen=f"127.0.0.1:{_PORT}",
    prepare=_prepare,
    started=_started,
)
