"""The embedded router: a Zenoh session in router mode, reopened when its rules or keys change.

Zenoh accepts no new rules while it runs. Reopening takes milliseconds, and clients reconnect; a revoked
client has no rights afterwards.
"""

import asyncio
import json
import logging
import os
import shlex
import ssl
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import zenoh

from robomesh import reason_codes as codes
from robomesh.contract.certificate_identity import read_identity
from robomesh.contract.endpoints import Link, Tls, first_line, router_config, router_values
from robomesh.errors import ListenError, RobomeshError, UnavailableError
from robomesh.listen_address import check_reach, own_addresses, split_address
from robomesh.schemas.robomesh_pb2 import Event
from robomesh.wire.session import SessionSettings
from services.errors import ServiceError
from services.router.peer_audit import find_impostors, to_other_sites, without_rights
from services.router.rolling_restart import neighbours, wait_for_turn
from services.router.status import StatusPublisher
from services.used_ports import check_free, is_absent

log = logging.getLogger(__name__)

_CHECK_EVERY_S = 0.5
_RETRY_S = 0.2
_REVOKED = "its certificate was revoked, or the rules do not name it"
_KEEPS_CURRENT = "the router keeps its current rules and keys"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A router's addresses, links and access rules.

    Attributes:
        site: Site for which it publishes its health; empty: it publishes nothing.
        access: File of access rules, written by `robomesh keys`; None: every client has all rights.
        metrics: Host and port for Prometheus; None: no metrics.
        line_bps: Bandwidth of the lines to other routers [bit/s]; None if unknown.
    """

    site: str = ""
    listen: tuple[str, ...] = ("tcp/127.0.0.1:7447",)
    connect: tuple[str | Link, ...] = ()
    tls: Tls | None = None
    access: Path | None = None
    insecure: bool = False
    metrics: tuple[str, int] | None = None
    line_bps: float | None = None


class AccessError(ServiceError):
    """A router's rules cannot be read, or Zenoh rejects them."""


async def serve(settings: Settings, *, ready: Callable[[str], None] | None = None) -> None:
    """Route until cancelled, by the current rules and keys in their files.

    Raises:
        ListenError: If other machines can reach an address without TLS and `insecure`.
        UnavailableError: If an address is in use.
        SessionError: If an endpoint is invalid.
        AccessError: If the rules cannot be read.
    """
    check_listen(settings)
    seen = _file_versions(settings)
    rules, site = read_access(settings.access), _own_site(settings)
    router = await _open(settings, rules)
    status = StatusPublisher()
    for endpoint in filter(_is_absent, settings.listen):
        status.problems[endpoint] = codes.ADDRESS_ABSENT(what="the router", address=endpoint)
        log.warning("%s", status.problems[endpoint])
    tasks = []
    if settings.site:
        mesh = SessionSettings(connect=own_addresses(settings.listen), tls=settings.tls)
        tasks.append(
            asyncio.create_task(
                status.run(
                    settings.site,
                    mesh,
                    metrics=settings.metrics,
                    router=lambda: router,
                    links=len(settings.connect),
                )
            )
        )
    reported: set[str] = set()
    try:
        if ready is not None:
            ready("routing on " + ", ".join(settings.listen))
        while True:
            await asyncio.sleep(_CHECK_EVERY_S)
            for endpoint in [endpoint for endpoint in status.problems if not _is_absent(endpoint)]:
                del status.problems[endpoint]
                log.info("the router listens on %s", endpoint)
            unknown = await asyncio.to_thread(without_rights, router, rules)
            for name in sorted(unknown - reported):
                status.publish_event(
                    Event.WARNING, "without_rights", f"{name} is connected, but has no right here: {_REVOKED}"
                )
            reported = unknown
            impostors = await asyncio.to_thread(
                find_impostors, router, settings.listen, settings.connect, site
            )
            if impostors:
                status.publish_event(Event.ERROR, "imposter", _cut_text(impostors, settings))
                own = tuple(link for link in settings.connect if not to_other_sites(link))
                settings = replace(settings, connect=own)
                await asyncio.to_thread(router.close)
                router, rules = await _reopen(settings, rules, rules)
            # After a cut there are fewer files, which is not a change.
            if (versions := _file_versions(settings)).items() <= seen.items():
                continue
            seen = versions
            try:
                wanted = read_access(settings.access)
                _check_keys(settings.tls)
                router_config(settings.listen, settings.connect, settings.tls, wanted, settings.line_bps)
            except (AccessError, RobomeshError) as error:
                status.publish_event(Event.ERROR, "rules", f"{error}; {_KEEPS_CURRENT}")
                continue
            others = await asyncio.to_thread(neighbours, router, settings.tls)
            await wait_for_turn(router, settings.tls, others)
            await asyncio.to_thread(router.close)
            router, rules = await _reopen(settings, wanted, rules)
            if rules is wanted:
                status.publish_event(Event.INFO, "rules", "the router follows the new rules and keys")
            else:
                status.publish_event(
                    Event.ERROR, "rules", f"{settings.access}: Zenoh rejects it; {_KEEPS_CURRENT}"
                )
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await asyncio.to_thread(router.close)


def read_access(path: Path | None) -> Mapping[str, Any]:
    """Read the sections of Zenoh's configuration in a rules file.

    Raises:
        AccessError: If it cannot be read, or has other content.
    """
    if path is None:
        return MappingProxyType({})
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        sections = json.loads("\n".join(line for line in lines if not line.lstrip().startswith("//")))
    except OSError as error:
        raise AccessError(
            f"{path}: cannot be read: {error.strerror}; robomesh keys init SITE.toml writes it"
        ) from None
    except ValueError as error:
        raise AccessError(f"{path}: not JSON: {error}; robomesh keys writes a new one") from None
    control = sections.get("access_control") if isinstance(sections, dict) else None
    if not isinstance(control, dict) or control.get("default_permission") != "deny":
        raise AccessError(
            f'{path}: access_control has no default_permission "deny": robomesh keys writes a new one'
        )
    if control.get("enabled") is not True:
        raise AccessError(
            f"{path}: access_control is not enabled, so no rule applies: robomesh keys writes a new one"
        )
    subjects = control.get("subjects")
    # For Zenoh a subject without names matches every client.
    if not isinstance(subjects, list) or not subjects or not all(map(_has_names, subjects)):
        raise AccessError(
            f"{path}: access_control needs subjects with cert_common_names: robomesh keys writes a new one"
        )
    return sections  # type: ignore[no-any-return]


def _has_names(subject: Any) -> bool:
    return isinstance(subject, dict) and bool(subject.get("cert_common_names"))


def write_config(settings: Settings, out: Path) -> str:
    """Write this router's configuration for zenohd.

    Returns:
        A text on what zenohd does differently.

    Raises:
        AccessError: If the rules cannot be read, or the file cannot be written.
        SessionError: If an endpoint is invalid.
    """
    values = router_values(
        settings.listen, settings.connect, settings.tls, read_access(settings.access), settings.line_bps
    )
    # Validates the configuration, and sets the number of threads in the environment, from which zenohd
    # takes it, too.
    router_config(settings.listen, settings.connect, settings.tls)
    threads = shlex.quote(os.environ["ZENOH_RUNTIME"])
    tree: dict[str, Any] = {}
    for key, value in values.items():
        *parents, last = key.split("/")
        node = tree
        for parent in parents:
            node = node.setdefault(parent, {})
        node[last] = value
    # zenohd always enables its admin space; without permissions no client can read it.
    tree["adminspace"] = {"enabled": False, "permissions": {"read": False, "write": False}}
    try:
        out.write_text(json.dumps(tree, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise AccessError(f"{out}: cannot be written: {error.strerror}") from None
    return (
        f"{out}: ZENOH_RUNTIME={threads} zenohd --config {out} routes like robomesh router, "
        "but reads its rules and certificates at its start only: write this file again and restart it after "
        "robomesh keys issue, renew or revoke. It publishes no presence, and does not audit the "
        "certificates of other sites' routers"
    )


def _cut_text(names: list[str], settings: Settings) -> str:
    sites = sorted({each.site for each in settings.connect if isinstance(each, Link)})
    return (
        f"the peer on the link to site {' or '.join(sites)} has a certificate of {', '.join(names)}, not of "
        "that site's router: all links to other sites are cut until this router is restarted"
    )


def _own_site(settings: Settings) -> str:
    if settings.site or settings.tls is None:
        return settings.site
    identity = read_identity(settings.tls.certificate)
    return "" if identity is None else identity.site


def check_listen(settings: Settings) -> None:
    """Log a warning for each address that every machine can reach.

    Raises:
        ListenError: If other machines can reach one without TLS and `insecure`.
    """
    for endpoint in settings.listen:
        protocol, _, address = endpoint.partition("/")
        host, _ = split_address(address.partition("?")[0])
        warning = check_reach(
            f"the router ({endpoint})", host, secured=protocol in ("tls", "quic"), insecure=settings.insecure
        )
        if warning:
            log.warning(warning)


def check_ports_free(endpoints: Iterable[str]) -> None:
    """Check that no other program listens on the router's TCP ports.

    Raises:
        ListenError: If one does.
    """
    for endpoint in endpoints:
        protocol, _, address = endpoint.partition("/")
        if protocol in ("tcp", "tls"):
            host, port = split_address(address.partition("?")[0])
            check_free("the router", host, port, "choose another address with [router] listen")


async def _open(settings: Settings, rules: Mapping[str, Any]) -> zenoh.Session:
    config = router_config(
        settings.listen,
        settings.connect,
        settings.tls,
        rules,
        settings.line_bps,
        may_come_late=any(map(_is_absent, settings.listen)),
    )
    try:
        return await asyncio.to_thread(zenoh.open, config)
    except zenoh.ZError as error:
        await asyncio.to_thread(check_ports_free, settings.listen)
        raise UnavailableError(
            f"the router cannot listen on {', '.join(settings.listen)}: {first_line(error)}; "
            "choose another address under [router] listen"
        ) from None


def _is_absent(endpoint: str) -> bool:
    host, _ = split_address(endpoint.partition("/")[2].partition("?")[0])
    return is_absent(host)


async def _reopen(
    settings: Settings, wanted: Mapping[str, Any], before: Mapping[str, Any]
) -> tuple[zenoh.Session, Mapping[str, Any]]:
    """Reopen with the new rules, or with the old ones if Zenoh rejects those; retry until it opens."""
    while True:
        for rules in (wanted, wanted, before):  # twice: at first the address may still be in use
            try:
                return await _open(settings, rules), rules
            except ListenError as error:
                log.error("%s", error)
            await asyncio.sleep(_RETRY_S)


def _check_keys(tls: Tls | None) -> None:
    """Check that a router could listen with its current certificate.

    Raises:
        AccessError: If the certificate is missing or incomplete, or the key belongs to another.
    """
    if tls is None:
        return
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_verify_locations(tls.ca)
        context.load_cert_chain(tls.certificate, tls.key, password="")  # never prompt for a password
    except OSError as error:  # includes OpenSSL's errors
        raise AccessError(f"{tls.certificate} cannot be used: {error}") from None


def _file_versions(settings: Settings) -> dict[Path, tuple[int, int]]:
    """Return the versions of the files that the router uses."""
    files = [settings.access] if settings.access is not None else []
    for tls in (settings.tls, *(link.tls for link in settings.connect if isinstance(link, Link))):
        if tls is not None:
            files += [tls.ca, tls.certificate, tls.key]
    return {file: _file_version(file) for file in files}


def _file_version(file: Path) -> tuple[int, int]:
    try:
        stat = file.stat()
    except OSError:
        return 0, 0
    return stat.st_ino, stat.st_mtime_ns
