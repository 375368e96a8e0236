"""The start of the simulated controller."""

from typing import Annotated

from protocol_gateway.seam.simulated import Common, Option, Run, Simulated, Started, options_of
from robomesh.listen_address import split_address


def _prepare(
    common: Common,
    *,
    yaskawa: Annotated[str, Option(metavar="JSON", help="The site file's table `yaskawa` as JSON")] = "",
) -> Run:
    from controllers.simulated.declared import declared_options
    from controllers.yaskawa.simulated.service import HsesSettings, serve_hses
    from controllers.yaskawa.table import Yaskawa

    declared = declared_options(Yaskawa, "hses", "--yaskawa", yaskawa)
    settings = HsesSettings(**common, yaskawa=declared)
    host = split_address(settings.listen)[0]
    return lambda tell: serve_hses(settings, ready=lambda port: tell(f"listening on udp {host}:{port}"))


HSES = Simulated(
    text="the High-Speed Ethernet Server of Yaskawa",
    listen="127.0.0.1:10040",
    prepare=_prepare,
    started=lambda table, _: Started(options_of(table, "--yaskawa")),
)
