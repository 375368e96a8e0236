"""The start of one service: its row of the table makes its Settings from the site file."""

from importlib import import_module

from robomesh.contract.endpoints import DEFAULT_ROUTER
from robomesh.contract.keys import WHOLE_SITE
from robomesh.listen_address import own_addresses
from robomesh.service import service
from robomesh.texts import split_commas
from robomesh.wire.session import SessionSettings
from services.command_line.service_settings.controllers import ControllerError
from services.command_line.service_settings.metrics_ports import own_address
from services.command_line.service_settings.table import SERVICES, Options
from services.command_line.terminal.connection_options import with_keys
from services.site_file import site as site_file
from services.site_file.site import Site
from services.site_file.started_robots import read_started


def launch(name: str, options: Options, connect: str, metrics: str = "") -> None:
    """Run a service of the table, except the router, until a signal.

    Args:
        connect: The routers to attach to, separated by commas.
        metrics: HOST:PORT of the Prometheus endpoint; empty: none.
    """
    service.log_to_stderr()
    row, site = SERVICES[name], site_file.load(options.site_file)
    assert row.settings is not None
    if options.started:
        site = _only_started(site, options.started)
    # The gateways of robots that were started from the page share a certificate of their own.
    certificate = "started" if options.started and name == "gateway" else name
    # A service with work to finish gets more time than the default.
    ends = {"ends_within_s": service.WRITES_WITHIN_S} if row.finishes else {}
    service.run(
        import_module(row.module).serve,
        row.settings(site, options),
        service=name,
        session_settings=session_settings(site, connect, certificate),
        present_for=[
            (site.site, robot)
            for robot in ([each.name for each in site.robot] if row.of_robots else [WHOLE_SITE])
        ],
        metrics=own_address(site, metrics, name, started=bool(options.started)),
        **ends,
    )


def session_settings(site: Site, connect: str, certificate: str) -> SessionSettings:
    """Return a session with the certificate of `--keys`, else with the site's own for this service."""
    given = with_keys(connect)
    if given is not None:
        return given
    routers, tls = split_commas(connect), site.tls_of(certificate)
    if routers == (DEFAULT_ROUTER,):
        routers = own_addresses(site.listened)
    return SessionSettings(connect=routers, tls=tls)


def _only_started(site: Site, name: str) -> Site:
    """Return the site with one robot only, which was started from the page."""
    robots = tuple(robot for robot in read_started(site) if robot.name == name)
    if not robots:
        raise ControllerError(f"--started {name}: no such robot was started from the page of {site.site}")
    # A started robot has no cell; fixtures of other cells name robots that this site lacks.
    fixtures = tuple(fixture for fixture in site.fixture if fixture.cell in {each.cell for each in robots})
    return site.model_copy(update={"robot": robots, "fixture": fixtures})
