"""The address at which each service of a site serves Prometheus: `[metrics] listen` or `--metrics`."""

import logging
from collections.abc import Callable, Hashable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from robomesh.errors import ListenError
from robomesh.listen_address import check_reach, split_address
from services.command_line.service_settings.table import SERVICES
from services.command_line.terminal.output import print_text
from services.site_file.tables.router import RoutedSite
from services.supervisor import ExtraPrograms, SupervisedProgram

if TYPE_CHECKING:  # the router imports this module, and starts quickly
    from services.site_file.site import Site

logger = logging.getLogger(__name__)

_MOST = 65535


def own_address(
    site: RoutedSite, text: str, service: str, *, started: bool = False
) -> tuple[str, int] | None:
    """Return host and port of one service's metrics; None: no metrics.

    Args:
        text: HOST:PORT of its `--metrics`; empty: the site file decides.
        started: It serves a robot that was started from the page, so it takes a free port.

    Raises:
        ListenError: If the address is invalid, or beyond loopback without the site's `insecure = true`.
    """
    listen = _checked(site, text)
    if listen is None or text:
        return listen
    return (listen[0], 0) if started else (listen[0], ports(listen)[service])


def first_address(site: RoutedSite, text: str) -> tuple[str, int] | None:
    """Return host and port of the first service's metrics; None: no metrics.

    Args:
        text: HOST:PORT of `robomesh up --metrics`; empty: the site file decides.

    Raises:
        ListenError: As `own_address`; or if there are not enough ports.
    """
    listen = _checked(site, text)
    if listen is not None:
        ports(listen)
    return listen


def ports(listen: tuple[str, int]) -> dict[str, int]:
    """Return each service's port, which does not depend on the services that the site runs.

    Args:
        listen: Host and port of the first service; port 0: each takes a free port.

    Raises:
        ListenError: If there are not enough ports.
    """
    host, first = listen
    if first and first + len(SERVICES) - 1 > _MOST:
        raise ListenError(
            f"metrics {host}:{first}: {len(SERVICES)} services take a port each from there; "
            f"the port must be at most {_MOST - len(SERVICES) + 1}"
        )
    return {name: first + number if first else 0 for number, name in enumerate(SERVICES)}


def with_metrics(
    programs: Sequence[SupervisedProgram], listen: tuple[str, int] | None
) -> tuple[SupervisedProgram, ...]:
    """Return the programs with `--metrics`; a simulated controller serves none.

    Args:
        listen: Host and port of the first service; None: no metrics.

    Raises:
        ListenError: If there are not enough ports.
    """
    if listen is None:
        return tuple(programs)
    shown, port_of = _shown(listen[0]), ports(listen)
    return tuple(
        replace(
            program, arguments=(*program.arguments, "--metrics", f"{shown}:{port_of[program.arguments[0]]}")
        )
        if program.arguments[0] in port_of
        else program
        for program in programs
    )


def extra_with_metrics(extra: ExtraPrograms, listen: tuple[str, int] | None) -> ExtraPrograms:
    """Return `extra` with metrics on free ports: the number of programs is not known beforehand."""
    if listen is None:
        return extra
    free = (listen[0], 0)

    def started(make: Callable[[], Sequence[SupervisedProgram]]) -> tuple[SupervisedProgram, ...]:
        return with_metrics(make(), free)

    def wanted() -> dict[Hashable, Callable[[], Sequence[SupervisedProgram]]]:
        return {key: partial(started, make) for key, make in extra().items()}

    return wanted


def print_scrape_config(path: Path | None, metrics: str) -> None:
    """Print the configuration of a Prometheus that monitors a site.

    Args:
        metrics: HOST:PORT of `robomesh up --metrics`; empty: the site file decides.

    Raises:
        ListenError: If neither gives an address with a fixed port.
    """
    from services.site_file import site as site_file

    site = site_file.load(path)
    listen = first_address(site, metrics)
    if listen is None:
        raise ListenError(
            f"{path or 'the built-in site'} has no address of metrics: write [metrics] with "
            'listen = "127.0.0.1:9101" into the site file, or give --metrics'
        )
    print_text(
        scrape_config(
            site, [name for name, row in SERVICES.items() if site.robot or not row.of_robots], listen
        )
    )


def scrape_config(site: "Site", services: Sequence[str], listen: tuple[str, int]) -> str:
    """Return a Prometheus configuration with the services as targets.

    Args:
        listen: Host and port of the first service.

    Raises:
        ListenError: If there are not enough ports, or the ports are not fixed.
    """
    host, first = listen
    if not first:
        raise ListenError(f"metrics {host}:0 are on free ports, which differ at each start: choose a port")
    shown, port_of = _shown({"0.0.0.0": "127.0.0.1", "::": "::1"}.get(host, host)), ports(listen)
    # For the alert of an alarm; of a page on all addresses, the one that people use is not known.
    on_all = split_address(site.console.listen)[0] in ("0.0.0.0", "::")
    page = "" if on_all else f', page: "{site.console.url}#/events"'
    targets = "\n".join(
        f'      - targets: ["{shown}:{port_of[name]}"]\n'
        f'        labels: {{ site: "{site.site}", service: "{name}"{page if name == "watch" else ""} }}'
        for name in services
    )
    return f"{_SCRAPE_CONFIG}{targets}"


_SCRAPE_CONFIG = """global:
  evaluation_interval: 5s
rule_files:
  - robomesh.rules.yml
scrape_configs:
  - job_name: robomesh
    scrape_interval: 5s
    # The rules take an answer that needs more than 1 s for a service that hangs.
    scrape_timeout: 2s
    # A metric of another site's robot keeps that site's name.
    honor_labels: true
    static_configs:
"""


def _checked(site: RoutedSite, text: str) -> tuple[str, int] | None:
    given = text or site.metrics.listen
    if not given:
        return None
    host, port = split_address(given)
    what = f"--metrics {text}" if text else f"[metrics] listen = {given!r}"
    remedy = "listen on 127.0.0.1, or write insecure = true under [router]"
    insecure = site.router.insecure
    if warning := check_reach(what, host, secured=False, insecure=insecure, remedy=remedy):
        logger.warning("%s", warning)
    return host, port


def _shown(host: str) -> str:
    return f"[{host}]" if ":" in host else host
