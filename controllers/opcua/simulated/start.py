"""The start of the simulated controller."""

from typing import Annotated

from protocol_gateway.seam.simulated import Common, Option, Run, Simulated, Started
from robomesh.extras import is_missing, missing
from robomesh.listen_address import split_address


def _prepare(
    common: Common,
    *,
    path: Annotated[str, Option(metavar="PATH", help="Path of the server's address, as /server")] = "",
) -> Run:
    if is_missing("asyncua"):
        from controllers.simulated.errors import SimulatorError

        raise SimulatorError(missing("asyncua", "opcua"))
    from controllers.opcua.simulated.service import OpcUaSimulatorSettings, serve_opcua

    settings = OpcUaSimulatorSettings(**common, path=path)
    host, shown = split_address(settings.listen)[0], settings.path.lstrip("/")
    return lambda tell: serve_opcua(
        settings, ready=lambda port: tell(f"listening on opc.tcp://{host}:{port}/{shown}".rstrip("/"))
    )


OPCUA = Simulated(
    text="an OPC UA server, OPC 40010-1",
    listen="127.0.0.1:4840",
    prepare=_prepare,
    started=lambda table, _: Started(("--path", path) if (path := getattr(table, "path", "")) else ()),
)
