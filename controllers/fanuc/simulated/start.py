"""The start of the simulated controllers."""

from collections.abc import Callable
from typing import Annotated, TypeAlias

from controllers.fanuc.table import Fanuc
from protocol_gateway.seam.simulated import Common, Option, Run, Simulated, Started, options_of
from protocol_gateway.seam.table import Table
from robomesh.listen_address import split_address

_Declared: TypeAlias = Annotated[str, Option(metavar="JSON", help="The site file's table `fanuc` as JSON")]
_Rmi: TypeAlias = Annotated[
    str, Option(metavar="HOST:PORT", help="RMI, on a real controller port 16001; empty: none")
]


def _prepare_snpx(common: Common, *, fanuc: _Declared = "", rmi: _Rmi = "") -> Run:
    from controllers.fanuc.simulated.service import FanucPorts, SnpxSettings, serve_snpx
    from controllers.simulated.declared import declared_options

    settings = SnpxSettings(**common, rmi=rmi, fanuc=declared_options(Fanuc, "snpx", "--fanuc", fanuc))
    host = split_address(settings.listen)[0]

    def line(ports: FanucPorts) -> str:
        return f"listening on {host}:{ports.snpx}" + (f", RMI on {ports.rmi}" if ports.rmi else "")

    return lambda tell: serve_snpx(settings, ready=lambda ports: tell(line(ports)))


def _prepare_ftp(common: Common, *, fanuc: _Declared = "") -> Run:
    from controllers.fanuc.simulated.service import FtpSettings, serve_ftp
    from controllers.simulated.declared import declared_options

    settings = FtpSettings(**common, fanuc=declared_options(Fanuc, "fanuc-ftp", "--fanuc", fanuc))
    host = split_address(settings.listen)[0]
    return lambda tell: serve_ftp(settings, ready=lambda port: tell(f"listening on {host}:{port}"))


def _started(table: Table | None, free_port: Callable[[], int]) -> Started:
    options = options_of(table, "--fanuc")
    if not isinstance(table, Fanuc) or not table.motion:
        return Started(options)
    rmi = free_port()
    return Started((*options, "--rmi", f"127.0.0.1:{rmi}"), (("rmi", rmi),))


SNPX = Simulated(text="SNPX of FANUC", listen="127.0.0.1:60008", prepare=_prepare_snpx, started=_started)
FTP = Simulated(
    text="the files of FANUC's state by FTP",
    listen="127.0.0.1:2121",
    prepare=_prepare_ftp,
    started=_started,
)
