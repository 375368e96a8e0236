"""Operations on a site's keys: make, issue, revoke, accept from another site.

Each change of the list of principals also writes the routers' rules, which a running router follows.
Operations of several processes run one after the other.
"""

import json
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from functools import wraps
from itertools import count
from typing import Concatenate, ParamSpec, TypeVar

from robomesh.contract.access_rights import Border, access_sections
from robomesh.contract.certificate_identity import Identity, header
from robomesh.contract.keys import check_name
from robomesh.contract.topics import PEOPLE, SERVICES, Role
from robomesh.errors import KeyNameError
from services.pki import certificates
from services.pki.errors import KeysError
from services.pki.folder import Folder, locked, read, write
from services.pki.principals import Entry, Principals, read_principals, write_principals

_P = ParamSpec("_P")
_R = TypeVar("_R")

LIFETIME = timedelta(days=30)
# The gateways of robots that are started from the page. Only the routers' rules name these robots: the list
# changes with the page, when no authority key is there to sign.
STARTED = "started"
_SERVICE_ROLES = (
    (STARTED, Role.GATEWAY),
    *((role.value, role) for role in sorted(SERVICES, key=lambda r: r.value)),
)


def exclusive(operation: "Callable[Concatenate[Folder, _P], _R]") -> "Callable[Concatenate[Folder, _P], _R]":
    """Hold the folder's lock during an operation, so that the list it reads is the list it replaces."""

    @wraps(operation)
    def locked_operation(folder: Folder, /, *arguments: _P.args, **named: _P.kwargs) -> _R:
        with locked(folder):
            return operation(folder, *arguments, **named)

    return locked_operation


def now() -> datetime:
    """Return the current time in UTC, in whole seconds."""
    return datetime.now(UTC).replace(microsecond=0)


def principals_of(folder: Folder) -> Principals:
    """Read the list of principals.

    Raises:
        KeysError: If the list is missing or invalid.
    """
    if not folder.principals.is_file():
        raise KeysError(
            f"{folder.principals} does not exist: robomesh keys init SITE.toml creates it; --folder names "
            "the folder of keys"
        )
    return read_principals(read(folder.principals).decode(errors="replace"), str(folder.principals))


def prepare(
    folder: Folder,
    site: str,
    *,
    robots: Sequence[str],
    border: Border,
    routers: Sequence[str],
    started: Sequence[str] = (),
) -> tuple[str, ...]:
    """Make what is missing: the authority, the list, a bundle for every service; write the rules.

    Args:
        robots: Robots of the site file; the site's gateway may publish for them.
        routers: Addresses of the site's routers.
        started: Robots that may be started from the page.

    Returns:
        The names that got certificates.

    Raises:
        KeysError: If the folder belongs to another site, or cannot be written.
    """
    check_name(site, "site")
    with locked(folder, make=True):
        made = _prepared(folder, site, tuple(robots), border, tuple(routers))
        _entitle(folder, started)
        return made


def _prepared(
    folder: Folder, site: str, robots: tuple[str, ...], border: Border, routers: tuple[str, ...]
) -> tuple[str, ...]:
    if folder.principals.is_file():
        principals = principals_of(folder)
        if principals.site != site:
            raise KeysError(f"{folder.path} holds the keys of site {principals.site}, not of {site}")
    else:
        principals = Principals(site=site)
    if not folder.authority.is_file():
        key, certificate = certificates.make_authority(site, now())
        write(folder.authority_key, key)
        write(folder.authority, certificate)
    principals = Principals(site=site, border=border, routers=routers, entries=principals.entries)
    made = []
    for name, role in _SERVICE_ROLES:
        there = principals.find(name)
        wanted = there or Entry(name=f"{name}.{site}", role=role)
        if name == Role.GATEWAY.value:
            wanted = wanted.model_copy(update={"robots": robots})
        # A bundle without an entry: this function was killed before it wrote the list.
        if wanted.revoked is None and (wanted != there or not folder.service(name).is_file()):
            principals = issued(folder, principals, wanted)
            made.append(wanted.name)
    save(folder, principals)
    return tuple(made)


def entitled(folder: Folder) -> frozenset[str]:
    """Return the robots that the gateways of started robots may publish for.

    Raises:
        KeysError: If the list is missing or invalid.
    """
    entry = principals_of(folder).find(STARTED)
    return frozenset(entry.robots or () if entry is not None else ())


@exclusive
def entitle(folder: Folder, started: Sequence[str]) -> None:
    """Let the gateways of started robots publish for these robots only.

    Raises:
        KeysError: If the list is missing or cannot be written.
    """
    _entitle(folder, started)


def _entitle(folder: Folder, started: Sequence[str]) -> None:
    principals = principals_of(folder)
    entry = principals.find(STARTED)
    robots = tuple(sorted(started))
    if entry is not None and entry.robots != robots:
        save(folder, principals.replaced(entry.model_copy(update={"robots": robots})))


@exclusive
def issue(
    folder: Folder,
    name: str,
    role: Role,
    *,
    robots: Sequence[str] | None = None,
    lifetime: timedelta = LIFETIME,
) -> Entry:
    """Issue a certificate for a person, a service, or another router or gateway of the site.

    Raises:
        KeysError: If the name is invalid, does not fit the role, is taken, or was revoked while one of its
            certificates is still valid.
    """
    principals = principals_of(folder)
    name = name.removesuffix("." + principals.site)
    full = f"{name}.{principals.site}"
    if folder.service(name) == folder.authority:
        raise KeysError(f"{full} is the authority's own name: choose another name")
    if role is Role.ROUTER and name.partition("-")[0] != Role.ROUTER.value:
        raise KeysError(f"{full}: other sites recognise a router by its name: choose router-2, router-3 ...")
    there = principals.find(full)
    if there is not None and there.role is not role and there.revoked is None:
        raise KeysError(
            f"{full} is {there.role.value} already: names are unique; choose another, as "
            f"{_unused_name(principals, there)}"
        )
    if robots is not None and role is not Role.GATEWAY:
        raise KeysError(f"--robots is for gateways: {full} would be {role.value}")
    if robots is None and role is Role.GATEWAY:
        raise KeysError(f"{full}: a gateway needs its robots: --robots a,b")
    if there is not None:
        _check_name_free(principals, there)
    entry = _entry(name=full, role=role, robots=None if robots is None else tuple(robots))
    principals = issued(folder, principals, entry, lifetime)
    save(folder, principals)
    found = principals.find(full)
    assert found is not None
    return found


@exclusive
def issue_guest(
    folder: Folder, site: str, *, sites: Sequence[str] = (), lifetime: timedelta = LIFETIME
) -> Entry:
    """Issue a certificate that lets another site's router connect.

    Args:
        sites: Sites that it may publish for; default: its own; `*`: all but this one (a hub).

    Raises:
        KeysError: If the site is invalid, or the name was revoked while a certificate is still valid.
    """
    principals = principals_of(folder)
    _check_other_site(principals, site)
    if (there := principals.find(f"router.{site}")) is not None:
        _check_name_free(principals, there)
    entry = _entry(name=f"router.{site}", role=Role.ROUTER, sites=tuple(sites) or (site,))
    principals = issued(folder, principals, entry, lifetime)
    save(folder, principals)
    found = principals.find(entry.name)
    assert found is not None
    return found


@exclusive
def accept(folder: Folder, data: bytes, *, sites: Sequence[str] = ()) -> str:
    """Accept a bundle with which this site's routers connect to another site; give its router rights here.

    Returns:
        The other site.

    Raises:
        KeysError: If the file is invalid, not for this site, or the other router was revoked here while its
            certificate is still valid.
    """
    principals = principals_of(folder)
    content = certificates.read_bundle(data)
    if content.role != Role.ROUTER.value or content.name.rpartition(".")[2] != principals.site:
        raise KeysError(
            f"it lets {content.name} ({content.role}) connect to site {content.authority}: for this site "
            f"run robomesh keys issue --guest {principals.site} there"
        )
    if content.expires <= now():
        raise KeysError(
            f"it expired on {content.expires:%Y-%m-%d %H:%M} UTC: site {content.authority} renews it"
        )
    _check_other_site(principals, content.authority)
    name = f"router.{content.authority}"
    there = principals.find(name)
    if there is not None:
        _check_name_free(principals, there)
    if there is None or there.revoked is not None or sites:
        entry = _entry(name=name, role=Role.ROUTER, sites=tuple(sites) or (content.authority,))
        if there is not None:
            kept = {"serial": there.serial, "fingerprint": there.fingerprint, "earlier": there.earlier}
            entry = entry.model_copy(update={**kept, "issued": there.issued, "expires": there.expires})
        principals = principals.replaced(entry)
    write(folder.link(content.authority), data)
    save(folder, principals)
    return content.authority


@exclusive
def revoke(folder: Folder, name: str) -> Entry:
    """Revoke a name; the routers disconnect its clients.

    Raises:
        KeysError: If the name has no certificate.
    """
    principals = principals_of(folder)
    entry = principals.find(name)
    if entry is None:
        raise KeysError(f"{name} has no certificate of this site: robomesh keys list shows the names")
    if entry.revoked is None:
        entry = entry.model_copy(update={"revoked": now()})
    save(folder, principals.replaced(entry))
    return entry


def rules_of(principals: Principals) -> str:
    """Return the text of the routers' rules."""
    sections = access_sections(principals.site, principals.allowed, principals.border)
    return (
        f"// Rights at site {principals.site}: robomesh keys writes this file from principals.toml.\n"
        + json.dumps(sections, indent=1)
        + "\n"
    )


def file_of(folder: Folder, site: str, entry: Entry) -> str:
    """Return the path of an entry's bundle."""
    name, _, of = entry.name.rpartition(".")
    if of != site:
        return str(folder.guest(of))
    return str(folder.person(name) if entry.role in PEOPLE else folder.service(name))


def _entry(**values: object) -> Entry:
    try:
        return Entry.model_validate(values)
    except ValueError:
        raise KeysError(
            f"{values['name']} is not valid: names are letters, digits, '_' and '-', robots and sites lower "
            "case, beginning with a letter or digit"
        ) from None


def _check_other_site(principals: Principals, site: str) -> None:
    try:
        check_name(site, "site")
    except KeyNameError as error:
        raise KeysError(str(error)) from None
    if site == principals.site:
        raise KeysError(f"{site} is this site: another site's router is a guest")


def _check_name_free(principals: Principals, entry: Entry) -> None:
    """Reject a revoked name while one of its certificates is valid: the rules would admit that one again.

    Raises:
        KeysError: If the name is not free.
    """
    if entry.revoked is None or entry.good_until is None or entry.good_until <= now():
        return
    ours = entry.name.rpartition(".")[2] == principals.site
    instead = (
        f"issue {_unused_name(principals, entry)} in its place"
        if ours
        else "until then only a new authority excludes the old certificate"
    )
    raise KeysError(
        f"{entry.name} was revoked, but a certificate of that name is valid until "
        f"{entry.good_until:%Y-%m-%d %H:%M} UTC and would be admitted again; {instead}"
    )


def _unused_name(principals: Principals, entry: Entry) -> str:
    """Return an unused name, made from a used one."""
    name = entry.name.rpartition(".")[0]
    return next(new for n in count(2) if principals.find(new := f"{name}-{n}") is None)


def issued(
    folder: Folder, principals: Principals, entry: Entry, lifetime: timedelta = LIFETIME
) -> Principals:
    """Issue an entry's certificate, write its bundle, and return the changed list."""
    if not folder.authority_key.is_file():
        raise KeysError(
            f"{folder.authority_key} does not exist: the authority's key is needed to sign; restore it first"
        )
    authority = certificates.read_authority(read(folder.authority_key), read(folder.authority))
    ours = entry.name.rpartition(".")[2] == principals.site
    made = certificates.issue(
        authority,
        entry.name,
        entry.role.value,
        now=now(),
        lifetime=lifetime,
        serves=ours and entry.role is Role.ROUTER,
    )
    identity = Identity(
        name=entry.name,
        role=entry.role,
        expires=made.expires,
        robots=None if entry.name == f"{STARTED}.{principals.site}" else entry.own_robots,
        routers=principals.routers,
    )
    data = header(identity).encode() + made.key + made.certificate + read(folder.authority)
    name, _, of = entry.name.rpartition(".")
    path = (
        folder.guest(of)
        if not ours
        else folder.person(name)
        if entry.role in PEOPLE
        else folder.service(name)
    )
    write(path, data)
    before = principals.find(entry.name)
    changes = {
        "earlier": None if before is None else before.good_until,
        "serial": made.serial,
        "fingerprint": made.fingerprint,
        "issued": made.issued,
        "expires": made.expires,
        "revoked": None,
    }
    return principals.replaced(entry.model_copy(update=changes))


def save(folder: Folder, principals: Principals) -> None:
    """Write the list, and the routers' rules if they have changed."""
    write(folder.principals, write_principals(principals).encode())
    rules = rules_of(principals).encode()
    # A router reloads when this file changes, which a renewed certificate alone does not require.
    if not folder.access.is_file() or read(folder.access) != rules:
        write(folder.access, rules)
