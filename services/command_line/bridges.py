"""`robomesh foxglove`, `robomesh ros2`: what people already use attaches to the mesh."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from robomesh.endpoints import DEFAULT_ROUTER
from services.command_line.connection_options import attachment, own_identity
from services.command_line.options import Connect, Metrics
from services.site_file.listen_address import check_reach, split_address

Robots = Annotated[
    list[str] | None,
    typer.Option("--robot", metavar="ROBOT", help="Only this one; more by repeating it. All unless given."),
]


def add(app: typer.Typer) -> None:
    """Give `robomesh` these commands."""
    app.command()(foxglove)
    app.command()(ros2)


def foxglove(
    listen: Annotated[str, typer.Option(metavar="HOST:PORT")] = "127.0.0.1:8765",
    robot: Robots = None,
    operator: Annotated[
        str, typer.Option(metavar="NAME", help="Offer commands, asked in this name; else stop alone.")
    ] = "",
    origin: Annotated[
        list[str] | None,
        typer.Option(metavar="URL", help="A web page that may attach, beside Foxglove's and this machine's."),
    ] = None,
    certificate: Annotated[
        Path | None, typer.Option(metavar="PEM", help="Of this server, for wss; its key in it, or apart.")
    ] = None,
    private_key: Annotated[Path | None, typer.Option(metavar="PEM", help="Of that certificate.")] = None,
    insecure: Annotated[bool, typer.Option(help="Listen beyond loopback, without any protection.")] = False,
    connect: Connect = DEFAULT_ROUTER,
    metrics: Metrics = "",
) -> None:
    """Serve Foxglove and Lichtblick: open a Foxglove WebSocket connection to ws://127.0.0.1:8765."""
    from robomesh import service
    from services import foxglove as role

    service.log_to_stderr()
    settings = role.Settings(
        listen=listen,
        robots=tuple(robot or ()),
        site=_site(),
        metrics=_metrics(metrics),
        operator=operator,
        origins=tuple(origin or ()),
        certificate=certificate,
        private_key=private_key,
        insecure=insecure,
    )
    service.run(
        role.serve,
        settings,
        service="foxglove",
        session_settings=attachment(connect),
        present_for=(),
    )


def ros2(
    domain: Annotated[int, typer.Option(metavar="N", min=0, max=232, help="ROS_DOMAIN_ID.")] = 0,
    robot: Robots = None,
    node: Annotated[str, typer.Option(metavar="NAME", help="In the ROS graph.")] = "robomesh",
    meshes: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="For the files that /robot_description names.")
    ] = None,
    connect: Connect = DEFAULT_ROUTER,
    metrics: Metrics = "",
) -> None:
    """Show the robots to ROS 2 nodes with rmw_zenoh: /joint_states, /tf, /robot_description."""
    from robomesh import service
    from services import ros2 as role

    service.log_to_stderr()
    settings = role.Settings(
        domain=domain, robots=tuple(robot or ()), site=_site(), metrics=_metrics(metrics), node=node
    )
    if meshes is not None:
        settings = replace(settings, meshes=meshes)
    service.run(
        role.serve,
        settings,
        service="ros2",
        session_settings=attachment(connect),
        present_for=(),
    )


def _site() -> str:
    """Where it is present: at the site of its certificate; empty: it has none."""
    identity = own_identity()
    return "" if identity is None else identity.site


def _metrics(address: str) -> tuple[str, int] | None:
    """Where Prometheus may ask, which knows no users: on loopback."""
    if not address:
        return None
    host, port = split_address(address)
    check_reach("metrics", host, secured=False, insecure=False, remedy="listen on 127.0.0.1")
    return host, port
