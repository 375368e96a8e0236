"""The commands that run a site, or one service of it."""

from pathlib import Path
from typing import Annotated, Any

import typer

from robomesh.contract.endpoints import DEFAULT_ROUTER
from services.command_line.terminal.options import Connect, Metrics, SiteFile, Started, command_group

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
    from services.command_line.service_settings.metrics_ports import print_scrape_config

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


def _run(name: str, site: Path | None, connect: str, metrics: str, **options: Any) -> None:
    from services.command_line.service_settings.table import Options
    from services.command_line.site.launch import launch

    launch(name, Options(site_file=site, **options), connect, metrics)
