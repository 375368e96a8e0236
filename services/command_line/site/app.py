"""The commands that run a site, or one service of it."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from robomesh.endpoints import DEFAULT_ROUTER
from services.command_line.options import Connect, Metrics, SiteFile, Started, command_group
from services.simulator.fault_table import FAULTS

app = command_group()

Supervised = Annotated[
    bool,
    typer.Option(help="robomesh up runs every service of the site, and the robots that the page starts."),
]


@app.command()
def up(
    site: Annotated[Path | None, typer.Argument(metavar="[SITE.toml]", help="The site file.")] = None,
    metrics: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            help="Serve Prometheus: the router on this port, the others on the following ones, instead of at "
            "the site file's [metrics]; port 0: free ports. The log lists them.",
        ),
    ] = "",
) -> None:
    """Run a whole site; without a file, the built-in one with a simulated arm."""
    from services.command_line.site import up as command

    command.run(site, metrics)


@app.command()
def metrics(
    site: Annotated[Path | None, typer.Argument(metavar="[SITE.toml]", help="The site file.")] = None,
    listen: Annotated[
        str,
        typer.Option(
            "--metrics", metavar="HOST:PORT", help="As of robomesh up; else the site file's [metrics]."
        ),
    ] = "",
) -> None:
    """Print a Prometheus configuration that scrapes every service of a site."""
    from services.command_line.site.metrics_ports import print_scrape_config

    print_scrape_config(site, listen)


@app.command()
def router(
    site: SiteFile = None,
    config_out: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the configuration for zenohd, and exit.")
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
        typer.Option(metavar="ROBOT=tcp://HOST:PORT", help="A robot's controller; else the site file's."),
    ] = None,
    started: Started = "",
    metrics: Metrics = "",
) -> None:
    """Put the site's controllers on the mesh."""
    _run("gateway", site, connect, metrics, controllers=controller or (), started=started)


@app.command()
def kinematics(
    site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, started: Started = "", metrics: Metrics = ""
) -> None:
    """Publish what the robots are and where their links are."""
    _run("kinematics", site, connect, metrics, started=started)


@app.command()
def recorder(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Record robots on request."""
    _run("recorder", site, connect, metrics)


@app.command()
def player(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Play recordings back as separate robots."""
    _run("player", site, connect, metrics)


@app.command()
def renderer(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Draw the robots off screen and publish video."""
    _run("renderer", site, connect, metrics)


@app.command()
def console(
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
    supervised: Supervised = False,
    metrics: Metrics = "",
) -> None:
    """Serve the page."""
    _run("console", site, connect, metrics, supervised=supervised)


@app.command()
def watch(
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
    supervised: Supervised = False,
    metrics: Metrics = "",
) -> None:
    """Hold the site's alarms, and check presence, clocks, versions and names."""
    _run("watch", site, connect, metrics, supervised=supervised)


@app.command()
def store(site: SiteFile = None, connect: Connect = DEFAULT_ROUTER, metrics: Metrics = "") -> None:
    """Store the site's programs with all their versions."""
    _run("store", site, connect, metrics)


class SimulatedProtocol(StrEnum):
    """Protocol of a simulated controller."""

    UNIT = "unit"
    RTDE = "rtde"
    HSES = "hses"
    SNPX = "snpx"
    FANUC_FTP = "fanuc-ftp"
    OPCUA = "opcua"


@app.command()
def simulate(
    robot: Annotated[
        str,
        typer.Option(
            metavar="R",
            help="A library robot or a description.",
            show_default="pt600; with the other protocols puma560",
        ),
    ] = "",
    listen: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            show_default="127.0.0.1:5400; with rtde :30004, with hses :10040, with snpx :60008, "
            "with fanuc-ftp :2121, with opcua :4840",
        ),
    ] = "",
    rate: Annotated[float, typer.Option(metavar="HZ", min=1, max=1000, help="With unit.")] = 100.0,
    max_clients: Annotated[int, typer.Option(metavar="N", min=1, help="With unit.")] = 8,
    demo: Annotated[bool, typer.Option(help="Move until the first command.")] = False,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[@BEGIN][+LENGTH]",
            help=f"A fault, BEGIN seconds after the first client connects: {', '.join(FAULTS)}.",
        ),
    ] = None,
    code: Annotated[
        list[str] | None,
        typer.Option(metavar="NUMBER=TYPE", help="A type code of the site file: 2=ABSOLUTE.DEG; with unit."),
    ] = None,
    insecure: Annotated[bool, typer.Option(help="Listen beyond loopback without protection.")] = False,
    protocol: Annotated[
        SimulatedProtocol,
        typer.Option(
            help="unit: the old text protocol; rtde: RTDE, scripts and the dashboard of Universal Robots; "
            "hses: the High-Speed Ethernet Server of Yaskawa; snpx: SNPX of FANUC; "
            "fanuc-ftp: the files of FANUC's state by FTP; opcua: an OPC UA server, OPC 40010-1."
        ),
    ] = SimulatedProtocol.UNIT,
    primary: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            help="The primary interface for reading; with rtde.",
            show_default="as --listen, port 30011",
        ),
    ] = "",
    scripts: Annotated[
        list[str] | None,
        typer.Option(
            metavar="HOST:PORT",
            help="An interface that takes scripts; with rtde.",
            show_default="as --listen, ports 30001, 30002, 30003",
        ),
    ] = None,
    dashboard: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT",
            help="The dashboard server; with rtde.",
            show_default="as --listen, port 29999",
        ),
    ] = "",
    yaskawa: Annotated[
        str, typer.Option(metavar="JSON", help="The site file's table `yaskawa` as JSON; with hses.")
    ] = "",
    fanuc: Annotated[
        str,
        typer.Option(metavar="JSON", help="The site file's table `fanuc` as JSON; with snpx and fanuc-ftp."),
    ] = "",
    rmi: Annotated[
        str,
        typer.Option(
            metavar="HOST:PORT", help="RMI, on a real controller port 16001; empty: none; with snpx."
        ),
    ] = "",
    path: Annotated[
        str, typer.Option(metavar="PATH", help="Path of the server's address, as /server; with opcua.")
    ] = "",
    for_: Annotated[
        str,
        typer.Option("--for", metavar="SITE/ROBOT", help="Accept `robomesh fault` for this robot."),
    ] = "",
    site: SiteFile = None,
    connect: Connect = DEFAULT_ROUTER,
) -> None:
    """Run a simulated controller with the old text protocol, RTDE, HSES, SNPX, FTP or OPC UA."""
    from services.command_line.site import simulated_controller

    simulated_controller.run(
        protocol,
        {
            "rate": rate,
            "max_clients": max_clients,
            "code": code or [],
            "primary": primary,
            "scripts": scripts or [],
            "dashboard": dashboard,
            "yaskawa": yaskawa,
            "fanuc": fanuc,
            "rmi": rmi,
            "path": path,
        },
        robot=robot,
        listen=listen,
        demo=demo,
        faults=tuple(fault or ()),
        insecure=insecure,
        mesh=simulated_controller.faults_mesh(for_, site, connect),
    )


def _run(name: str, site: Path | None, connect: str, metrics: str, **options: Any) -> None:
    from services.command_line.site.launch import launch
    from services.command_line.site.services import Options

    launch(name, Options(site_file=site, **options), connect, metrics)
