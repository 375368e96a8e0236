"""What certificates a router is shown: who is attached without a right, who is not who he should be.

A link to another site trusts that site's authority, which could sign any name: also one of ours, whose
rights our rules would give it. So links to other sites are cut, and stay so, when one of them shows another
name than that site's router.
"""

import ipaddress
import re
from collections.abc import Mapping
from typing import Any

import zenoh

from robomesh.endpoints import Link
from robomesh.topics import Role

_ADDRESS = re.compile(r"/\[?([^\]/?#]*)\]?:(\d+)(?:[?#]|$)")


def imposters(
    router: zenoh.Session, listen: tuple[str, ...], links: tuple[str | Link, ...], site: str
) -> list[str]:
    """Names that were shown on links which we opened, and that nobody may have there.

    Args:
        site: Our own, whose authority signs for links that name no site; empty: nobody knows.
    """
    far = {(_address(endpoint), of) for endpoint, of in _ends(links, site)}
    if all(of == site for _, of in far):
        return []
    ours = {_address(endpoint)[1] for endpoint in listen}
    found = set()
    for link in router.info.links():
        name, end = link.auth_identifier or "", _address(str(link.dst))
        if name and _address(str(link.src))[1] not in ours:
            sites = {of for address, of in far if _may_be(address, end)} or {of for _, of in far}
            found |= set() if _is_router_of(name, sites) else {name}
    return sorted(found)


def to_other_sites(link: str | Link) -> bool:
    """Whether a link is by another site's authority."""
    return isinstance(link, Link) and bool(link.site)


def without_rights(router: zenoh.Session, rules: Mapping[str, Any]) -> set[str]:
    """Names that are attached, and that no rule is for: revoked, or never known. They can do nothing."""
    if "access_control" not in rules:
        return set()
    subjects = rules["access_control"].get("subjects", ())
    known = {name for subject in subjects for name in subject.get("cert_common_names", ())}
    return {link.auth_identifier or "somebody without a certificate" for link in router.info.links()} - known


def _is_router_of(name: str, sites: set[str]) -> bool:
    first, _, site = name.rpartition(".")
    return "" in sites or (site in sites and first.partition("-")[0] == Role.ROUTER.value)


def _ends(links: tuple[str | Link, ...], site: str) -> list[tuple[str, str]]:
    return [(each.endpoint, each.site or site) if isinstance(each, Link) else (each, site) for each in links]


def _address(endpoint: str) -> tuple[str, str]:
    found = _ADDRESS.search(endpoint)
    return (found[1], found[2]) if found else ("", "")


def _may_be(configured: tuple[str, str], end: tuple[str, str]) -> bool:
    """Whether a link with that end may be one that was asked for; hosts' names are not looked up."""
    try:
        same_host = ipaddress.ip_address(configured[0]) == ipaddress.ip_address(end[0])
    except ValueError:
        same_host = True
    return same_host and configured[1] == end[1]
