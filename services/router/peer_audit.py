"""Audit of peers' certificates: clients without rights, and impostors on links to other sites.

A link to another site trusts that site's authority, which could sign any name, even one of this site, and
would get that name's rights. If a link shows another name than that site's router, all links to other sites
are cut until the router is restarted.
"""

import ipaddress
import re
from collections.abc import Mapping
from typing import Any

import zenoh

from robomesh.contract.endpoints import Link
from robomesh.contract.topics import Role

_ADDRESS = re.compile(r"/\[?([^\]/?#]*)\]?:(\d+)(?:[?#]|$)")


def find_impostors(
    router: zenoh.Session, listen: tuple[str, ...], links: tuple[str | Link, ...], site: str
) -> list[str]:
    """Return the names of peers on outgoing links that are not a router of the linked site.

    Args:
        site: This site, which links without a site belong to; empty if unknown.
    """
    linked = {(_address(endpoint), of) for endpoint, of in _ends(links, site)}
    if all(of == site for _, of in linked):
        return []
    own_ports = {_address(endpoint)[1] for endpoint in listen}
    found = set()
    for link in router.info.links():
        name, end = link.auth_identifier or "", _address(str(link.dst))
        if name and _address(str(link.src))[1] not in own_ports:
            sites = {of for address, of in linked if _may_be(address, end)} or {of for _, of in linked}
            found |= set() if _is_router_of(name, sites) else {name}
    return sorted(found)


def to_other_sites(link: str | Link) -> bool:
    """Return whether a link uses another site's authority."""
    return isinstance(link, Link) and bool(link.site)


def without_rights(router: zenoh.Session, rules: Mapping[str, Any]) -> set[str]:
    """Return the names of connected clients without a rule: revoked, or unknown. They have no rights."""
    if "access_control" not in rules:
        return set()
    subjects = rules["access_control"].get("subjects", ())
    known = {name for subject in subjects for name in subject.get("cert_common_names", ())}
    return {link.auth_identifier or "a client without a certificate" for link in router.info.links()} - known


def _is_router_of(name: str, sites: set[str]) -> bool:
    first, _, site = name.rpartition(".")
    return "" in sites or (site in sites and first.partition("-")[0] == Role.ROUTER.value)


def _ends(links: tuple[str | Link, ...], site: str) -> list[tuple[str, str]]:
    return [(each.endpoint, each.site or site) if isinstance(each, Link) else (each, site) for each in links]


def _address(endpoint: str) -> tuple[str, str]:
    found = _ADDRESS.search(endpoint)
    return (found[1], found[2]) if found else ("", "")


def _may_be(configured: tuple[str, str], end: tuple[str, str]) -> bool:
    """Return whether a link's end may be a configured one; host names are not resolved."""
    try:
        same_host = ipaddress.ip_address(configured[0]) == ipaddress.ip_address(end[0])
    except ValueError:
        same_host = True
    return same_host and configured[1] == end[1]
