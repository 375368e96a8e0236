"""`robomesh router`: reads only a part of the site file, because its restart has to be quick."""

from pathlib import Path

from robomesh.service import service
from services import router
from services.command_line.service_settings.metrics_ports import own_address
from services.command_line.terminal.output import print_line
from services.pki import Folder
from services.site_file.tables.router import RoutedSite, read_routed
from services.supervisor import wait_as_standby


def run(path: Path | None, config_out: Path | None = None, metrics: str = "") -> None:
    """Run the router of the site."""
    service.log_to_stderr()
    wait_as_standby()
    # zenohd may run in another folder.
    site = _read(path if path is None or config_out is None else path.absolute())
    settings = _settings(site, own_address(site, metrics, "router"))
    if config_out is not None:
        print_line(router.write_config(settings, config_out))
        return
    service.run_until_signalled(router.serve(settings, ready=print))


def _read(path: Path | None) -> RoutedSite:
    if path is None:
        return RoutedSite(site="demo")
    site = read_routed(path)
    if site is None:
        from services.site_file.site import load  # half of a router's start; only to report an invalid file

        site = load(path)
    return site


def _settings(site: RoutedSite, metrics: tuple[str, int] | None) -> router.Settings:
    access = site.router.access
    if access is None and site.keys.folder is not None:
        access = Folder(site.keys.folder).access
    return router.Settings(
        site=site.site,
        listen=site.listened,
        connect=site.links,
        tls=site.tls_of("router"),
        access=access,
        insecure=site.router.insecure,
        metrics=metrics,
        line_bps=None if site.router.line_mbit is None else site.router.line_mbit * 1e6,
    )
