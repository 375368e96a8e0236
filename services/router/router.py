"""The embedded router: a Zenoh session in router mode, opened anew when its rules or keys change.

Zenoh takes no new rules while it runs. What opens a router anew takes milliseconds, and clients come back
by themselves; whoever was revoked comes back to nothing.
"""

import asyncio
import json
import logging
import os
import shlex
import ssl
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import zenoh

from robomesh.certificate_identity import read_identity
from robomesh.endpoints import Link, Tls, first_line, router_config, router_values
from robomesh.errors import BusError
from robomesh.schemas.robomesh_pb2 import Event
from robomesh.session import SessionSettings
from services.errors import ListenError, ServiceError
from services.router.peer_audit import imposters, to_other_sites, without_rights
from services.router.rolling_restart import neighbours, our_turn
from services.router.status import Telling
from services.site_file.listen_address import check_reach, reachable, split_address

log = logging.getLogger(__name__)

_LOOK_S = 0.5
_AGAIN_S = 0.2
_REVOKED = "its certificate was revoked, or the rules do not name it"
_GOES_ON = "the router goes on with the rules and keys that it has"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What a router listens on, whom it links to, and who may do what.

    Attributes:
        site: Whose router it is, which its health is told for; empty: it tells nobody.
        access: Sections of Zenoh's configuration that `robomesh keys` wrote; None: everybody may everything.
        metrics: Host and port at which Prometheus may ask; None: nowhere.
        line_bps: What the lines to other routers carry [bit/s]; None: nobody knows.
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
    """Rules for a router that cannot be read, or that Zenoh does not take."""


async def serve(settings: Settings, *, ready: Callable[[str], None] | None = None) -> None:
    """Route until cancelled, by the rules and keys as they are in their files now.

    Raises:
        ListenError: If an address is taken, or beyond loopback without TLS and `insecure`.
        SessionError: If an endpoint is not one of Zenoh's.
        AccessError: If the rules cannot be read.
    """
    check_listen(settings)
    seen = _stamps(settings)
    rules, site = read_access(settings.access), _own_site(settings)
    router = await _open(settings, rules)
    told = Telling()
    tasks = []
    if settings.site:
        mesh = SessionSettings(connect=tuple(map(reachable, settings.listen)), tls=settings.tls)
        tasks.append(
            asyncio.create_task(
                told.tell(
                    settings.site,
                    mesh,
                    metrics=settings.metrics,
                    router=lambda: router,
                    links=len(settings.connect),
                )
            )
        )
    strangers: set[str] = set()
    try:
        if ready is not None:
            ready("routing on " + ", ".join(settings.listen))
        while True:
            await asyncio.sleep(_LOOK_S)
            unknown = await asyncio.to_thread(without_rights, router, rules)
            for name in sorted(unknown - strangers):
                told.say(
                    Event.WARNING, "without_rights", f"{name} is attached, and has no right here: {_REVOKED}"
                )
            strangers = unknown
            false = await asyncio.to_thread(imposters, router, settings.listen, settings.connect, site)
            if false:
                told.say(Event.ERROR, "imposter", _cut(false, settings))
                own = tuple(link for link in settings.connect if not to_other_sites(link))
                settings = replace(settings, connect=own)
                await asyncio.to_thread(router.close)
                router, rules = await _open_again(settings, rules, rules)
            # After a cut there are fewer files: that is no change.
            if (stamps := _stamps(settings)).items() <= seen.items():
                continue
            seen = stamps
            try:
                wanted = read_access(settings.access)
                _check_keys(settings.tls)
                router_config(settings.listen, settings.connect, settings.tls, wanted, settings.line_bps)
            except (AccessError, BusError) as error:
                told.say(Event.ERROR, "rules", f"{error}; {_GOES_ON}")
                continue
            others = await asyncio.to_thread(neighbours, router, settings.tls)
            await our_turn(router, settings.tls, others)
            await asyncio.to_thread(router.close)
            router, rules = await _open_again(settings, wanted, rules)
            if rules is wanted:
                told.say(Event.INFO, "rules", "the router follows the new rules and keys")
            else:
                told.say(Event.ERROR, "rules", f"{settings.access}: Zenoh does not take it; {_GOES_ON}")
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await asyncio.to_thread(router.close)


def read_access(path: Path | None) -> Mapping[str, Any]:
    """The sections of a router's configuration that a file of rules holds.

    Raises:
        AccessError: If it cannot be read, or holds something else.
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
        raise AccessError(f"{path}: not JSON: {error}; robomesh keys writes it anew") from None
    control = sections.get("access_control") if isinstance(sections, dict) else None
    if not isinstance(control, dict) or control.get("default_permission") != "deny":
        raise AccessError(
            f'{path}: access_control with default_permission "deny" is missing: robomesh keys writes it anew'
        )
    if control.get("enabled") is not True:
        raise AccessError(
            f"{path}: access_control is not enabled, so it keeps no rule: robomesh keys writes it anew"
        )
    subjects = control.get("subjects")
    # Zenoh takes a subject without names for everybody.
    if not isinstance(subjects, list) or not subjects or not all(map(_has_names, subjects)):
        raise AccessError(
            f"{path}: access_control needs subjects with cert_common_names: robomesh keys writes it anew"
        )
    return sections  # type: ignore[no-any-return]


def _has_names(subject: Any) -> bool:
    return isinstance(subject, dict) and bool(subject.get("cert_common_names"))


def write_config(settings: Settings, out: Path) -> str:
    """Write what this router runs with as a configuration for zenohd.

    Returns:
        What zenohd does otherwise, for people.

    Raises:
        AccessError: If the rules cannot be read, or the file not written.
        SessionError: If an endpoint is not one of Zenoh's.
    """
    values = router_values(
        settings.listen, settings.connect, settings.tls, read_access(settings.access), settings.line_bps
    )
    # Refuses what Zenoh would not take, and says with how many threads a router runs: zenohd takes them from
    # its environment, like ours.
    router_config(settings.listen, settings.connect, settings.tls)
    threads = shlex.quote(os.environ["ZENOH_RUNTIME"])
    tree: dict[str, Any] = {}
    for key, value in values.items():
        *parents, last = key.split("/")
        node = tree
        for parent in parents:
            node = node.setdefault(parent, {})
        node[last] = value
    # zenohd enables its admin space whatever is said here; nobody may read what is in it.
    tree["adminspace"] = {"enabled": False, "permissions": {"read": False, "write": False}}
    try:
        out.write_text(json.dumps(tree, indent=1) + "\n", encoding="utf-8")
    except OSError as error:
        raise AccessError(f"{out}: cannot be written: {error.strerror}") from None
    return (
        f"{out}: ZENOH_RUNTIME={threads} zenohd --config {out} routes as robomesh router does, "
        "but reads its rules and certificates at its start only: write this file anew and restart it after "
        "robomesh keys issue, renew or revoke. It tells nobody that it is there, and does not look at what "
        "certificates other sites' routers show"
    )


def _cut(names: list[str], settings: Settings) -> str:
    sites = sorted({each.site for each in settings.connect if isinstance(each, Link)})
    return (
        f"where a router of site {' or '.join(sites)} should be, somebody shows a certificate of "
        f"{', '.join(names)}: all links to other sites are cut until this router is started again"
    )


def _own_site(settings: Settings) -> str:
    if settings.site or settings.tls is None:
        return settings.site
    identity = read_identity(settings.tls.certificate)
    return "" if identity is None else identity.site


def check_listen(settings: Settings) -> None:
    """Warn of what anybody can reach.

    Raises:
        ListenError: If that is beyond loopback without TLS and `insecure`.
    """
    for endpoint in settings.listen:
        protocol, _, address = endpoint.partition("/")
        host, _ = split_address(address.partition("?")[0])
        warning = check_reach(
            f"the router ({endpoint})", host, secured=protocol in ("tls", "quic"), insecure=settings.insecure
        )
        if warning:
            log.warning(warning)


async def _open(settings: Settings, rules: Mapping[str, Any]) -> zenoh.Session:
    config = router_config(settings.listen, settings.connect, settings.tls, rules, settings.line_bps)
    try:
        return await asyncio.to_thread(zenoh.open, config)
    except zenoh.ZError as error:
        raise ListenError(
            f"the router cannot listen on {', '.join(settings.listen)}: {first_line(error)}; "
            "is another one running there? Name another under [router] listen"
        ) from None


async def _open_again(
    settings: Settings, wanted: Mapping[str, Any], before: Mapping[str, Any]
) -> tuple[zenoh.Session, Mapping[str, Any]]:
    """With the new rules; with those before where Zenoh takes no new ones, until it opens."""
    while True:
        for rules in (wanted, wanted, before):  # twice: the first time an address may still be taken
            try:
                return await _open(settings, rules), rules
            except ListenError as error:
                log.error("%s", error)
            await asyncio.sleep(_AGAIN_S)


def _check_keys(tls: Tls | None) -> None:
    """Whether a router could listen with its certificate as it is now.

    Raises:
        AccessError: If not: it is not there, is half copied, or has another's key.
    """
    if tls is None:
        return
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_verify_locations(tls.ca)
        context.load_cert_chain(tls.certificate, tls.key, password="")  # it asks nobody for one
    except OSError as error:  # OpenSSL's own among them
        raise AccessError(f"{tls.certificate} cannot be taken: {error}") from None


def _stamps(settings: Settings) -> dict[Path, tuple[int, int]]:
    """When the files that the router was opened with were written."""
    files = [settings.access] if settings.access is not None else []
    for tls in (settings.tls, *(link.tls for link in settings.connect if isinstance(link, Link))):
        if tls is not None:
            files += [tls.ca, tls.certificate, tls.key]
    return {file: _stamp(file) for file in files}


def _stamp(file: Path) -> tuple[int, int]:
    try:
        stat = file.stat()
    except OSError:
        return 0, 0
    return stat.st_ino, stat.st_mtime_ns
