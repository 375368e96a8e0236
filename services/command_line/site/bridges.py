"""`robomesh foxglove` and `robomesh ros2`: bridges to other tools."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.listen_address import check_reach, split_address
from services.command_line.terminal.connection_options import attachment, own_identity
from services.command_line.terminal.options import Connect, Metrics, command_group
from services.command_line.terminal.output import print_line
from services.foxglove.settings import Settings as Foxglove
from services.ros2.settings import Settings as Ros2

Robots = Annotated[
    list[str] | None,
    typer.Option("--robot", metavar="ROBOT", help="Only this robot; repeatable. Else all."),
]


app = command_group()


@app.command()
def foxglove(
    listen: Annotated[str, typer.Option(metavar="HOST:PORT")] = Foxglove.listen,
    robot: Robots = None,
    operator: Annotated[
        str, typer.Option(metavar="NAME", help="Offer commands, in this operator's name; else only stop.")
    ] = "",
    origin: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL", help="A web origin that may connect, besides Foxglove's and this machine's."
        ),
    ] = None,
    certificate: Annotated[
        Path | None,
        typer.Option(metavar="PEM", help="The server's certificate, for wss, with or without its key."),
    ] = None,
    private_key: Annotated[Path | None, typer.Option(metavar="PEM", help="The certificate's key.")] = None,
    insecure: Annotated[bool, typer.Option(help="Listen beyond loopback without protection.")] = False,
    layout: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Only write a layout for one --robot, to import.")
    ] = None,
    connect: Connect = DEFAULT_ROUTER,
    metrics: Metrics = "",
) -> None:
    """Serve Foxglove and Lichtblick on a Foxglove WebSocket, ws://127.0.0.1:8765."""
    if layout is not None:
        _write_layout(layout, robot or [], connect)
        return
    from robomesh.service import service
    from services.foxglove.server import serve

    service.log_to_stderr()
    settings = Foxglove(
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
        serve,
        settings,
        service="foxglove",
        session_settings=attachment(connect),
        present_for=(),
    )


def _write_layout(path: Path, robots: list[str], router: str) -> None:
    import json

    from robomesh.client.robot.robot import AsyncRobot
    from services.command_line.terminal import discovery
    from services.viewers.layout import viewer_layout

    if len(robots) != 1:
        raise typer.BadParameter("a layout shows one robot: add --robot ROBOT", param_hint="--layout")

    async def made() -> str:
        async with discovery.attached(router) as session:
            found = await discovery.find(session, robots[0])
            description = await AsyncRobot(session, *found).description()
            return json.dumps(viewer_layout(*found, description), indent=1)

    text = discovery.run(made())
    try:
        path.write_text(text + "\n", encoding="utf-8")
    except OSError as error:
        raise typer.BadParameter(
            f"{path}: cannot be written: {error.strerror}", param_hint="--layout"
        ) from None
    print_line(f"{path}: in Foxglove or Lichtblick, Layouts, Import from file")


@app.command()
def ros2(
    domain: Annotated[int, typer.Option(metavar="N", min=0, max=232, help="ROS_DOMAIN_ID.")] = Ros2.domain,
    robot: Robots = None,
    node: Annotated[str, typer.Option(metavar="NAME", help="Node name in the ROS graph.")] = Ros2.node,
    meshes: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder for the files that /robot_description names."),
    ] = None,
    connect: Connect = DEFAULT_ROUTER,
    metrics: Metrics = "",
) -> None:
    """Publish the robots to ROS 2 nodes with rmw_zenoh.

    Topics: /joint_states, /tf, /robot_description.
    """
    from robomesh.service import service
    from services.ros2.service import serve

    service.log_to_stderr()
    settings = Ros2(
        domain=domain, robots=tuple(robot or ()), site=_site(), metrics=_metrics(metrics), node=node
    )
    if meshes is not None:
        settings = replace(settings, shapes=meshes)
    service.run(
        serve,
        settings,
        service="ros2",
        session_settings=attachment(connect),
        present_for=(),
    )


def _site() -> str:
    """Return the certificate's site, where the bridge declares presence; empty without a certificate."""
    identity = own_identity()
    return "" if identity is None else identity.site


def _metrics(address: str) -> tuple[str, int] | None:
    """Parse the address for Prometheus, which has no authentication: loopback only."""
    if not address:
        return None
    host, port = split_address(address)
    check_reach("metrics", host, secured=False, insecure=False, remedy="listen on 127.0.0.1")
    return host, port
