"""The commands that run a site, or one service of it."""

from pathlib import Path
from typing import Annotated

import typer

from robomesh.endpoints import DEFAULT_ROUTER
from services.command_line.options import Connect, Metrics, SiteFile, Started, command_group
from services.simulator.fault_table import FAULTS

app = command_group()


@app.command()
def up(
    site: Annotated[Path | None, typer.Argument(metavar="[SITE.toml]", help="The site file.")] = None,
    metrics: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve Prometheus: the first service there, the others at the ports after it; "
            "port 0: free ones. The log tells each.",
        ),
    ] = "",
) -> None:
    """Run a whole site; without a file, the built-in one with a simulated arm."""
    from services.command_line.site import up as command

    command.run(site, metrics)


@app.command()
def router(
    site: SiteFile = None,
    config_out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write its configuration for zenohd, and end.")
    ] = None,
    metrics: Metrics = "",
) -> None:
    """Run a site's router."""
    from services.command_line.site import router

    router.run(site, config_out, metrics)


@app.command()
def gateway(
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
    controller: Annotated[
        list[str] | None,
        typer.Option(metavar="ROBOT=tcp://HOST:PORT", help="Where a robot's controller is, instead."),
    ] = None,
    started: Started = "",
    metrics: Metrics = "",
) -> None:
    """Put the site's controllers on the mesh."""
    from services.command_line.site import services

    services.gateway(site, connect, controller or [], started, metrics)


@app.command()
def kinematics(
    site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, started: Started = "", metrics: Metrics = ""
) -> None:
    """Publish what the robots are and where their links are."""
    from services.command_line.site import services

    services.kinematics(site, connect, started, metrics)


@app.command()
def recorder(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Record robots on request."""
    from services.command_line.site import services

    services.recorder(site, connect, metrics)


@app.command()
def player(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Play recordings back as separate robots."""
    from services.command_line.site import services

    services.player(site, connect, metrics)


@app.command()
def renderer(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Draw the robots off screen and publish video."""
    from services.command_line.site import services

    services.renderer(site, connect, metrics)


@app.command()
def console(
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
    supervised: Annotated[
        bool, typer.Option(help="Robots may be started from the page: a supervisor follows (robomesh up).")
    ] = False,
    metrics: Metrics = "",
) -> None:
    """Serve the page."""
    from services.command_line.site import services

    services.console(site, connect, supervised, metrics)


@app.command()
def watch(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Hold the site's alarms, and check presence, clocks, versions and names."""
    from services.command_line.site import services

    services.watch(site, connect, metrics)


@app.command()
def simulate(
    robot: Annotated[str, typer.Option(metavar="R", help="A library robot or a description.")] = "pt600",
    listen: Annotated[str, typer.Option(metavar="HOST:PORT")] = "127.0.0.1:5400",
    rate: Annotated[float, typer.Option(metavar="HZ", min=1, max=1000)] = 100.0,
    max_clients: Annotated[int, typer.Option(metavar="N", min=1)] = 8,
    demo: Annotated[bool, typer.Option(help="Move until the first command.")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[@BEGIN][+LENGTH]",
            help=f"Misbehaves, BEGIN seconds after the first client came: {', '.join(FAULTS)}.",
        ),
    ] = None,
    code: Annotated[
        list[str] | None,
        typer.Option(metavar="NUMBER=TYPE", help="A type code of the site file: 2=ABSOLUTE.DEG"),
    ] = None,
    insecure: Annotated[bool, typer.Option(help="Listen beyond loopback, without any protection.")] = False,
    for_: Annotated[
        str,
        typer.Option(
            "--for", metavar="SITE/ROBOT", help="Takes robomesh fault as this robot; else nobody's."
        ),
    ] = "",
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Run a simulated controller with the old text protocol."""
    from services.command_line.site import services

    services.simulate(
        robot=robot,
        listen=listen,
        rate_hz=rate,
        max_clients=max_clients,
        demo=demo,
        faults=tuple(fault or ()),
        codes=code or [],
        insecure=insecure,
        mesh=services.mesh_of_simulator(for_, site, connect) if for_ else None,
    )
