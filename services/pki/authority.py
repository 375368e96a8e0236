"""What is done with a site's keys: made, issued, revoked, taken from another site.

Whatever changes the list writes the routers' rules anew; a router that runs follows them. Deeds of several
processes come one after the other.
"""

import json
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta
from functools import wraps
from itertools import count
from typing import Concatenate, ParamSpec, TypeVar

from robomesh.access import Border, access_sections
from robomesh.certificate_identity import Identity, header
from robomesh.errors import KeyNameError
from robomesh.keys import check_name
from robomesh.topics import PEOPLE, SERVICES, Role
from services.pki import certificates
from services.pki.errors import KeysError
from services.pki.folder import Folder, locked, read, write
from services.pki.principals import Entry, Principals, read_principals, write_principals

_P = ParamSpec("_P")
_R = TypeVar("_R")

LIVES = timedelta(days=30)
# The gateways of robots that are started from the page. Which those may be only the routers' rules say: they
# follow the page, and no key is there to sign.
STARTED = "started"
_EVERY_SERVICE = (
    (STARTED, Role.GATEWAY),
    *((role.value, role) for role in sorted(SERVICES, key=lambda r: r.value)),
)


def alone(deed: "Callable[Concatenate[Folder, _P], _R]") -> "Callable[Concatenate[Folder, _P], _R]":
    """A deed that reads the list and writes it anew while nobody else does."""

    @wraps(deed)
    def done(folder: Folder, /, *arguments: _P.args, **named: _P.kwargs) -> _R:
        with locked(folder):
            return deed(folder, *arguments, **named)

    return done


def now() -> datetime:
    """Now, in UTC, in whole seconds."""
    return datetime.now(UTC).replace(microsecond=0)


def principals_of(folder: Folder) -> Principals:
    """The list of who has a certificate.

    Raises:
        KeysError: If there is none, or it is wrong.
    """
    if not folder.principals.is_file():
        raise KeysError(
            f"{folder.principals} is not there: robomesh keys init SITE.toml begins, and "
            "--folder says where the keys lie"
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
    """Make what is not there yet: the authority, the list, a bundle for every service; write the rules.

    Args:
        robots: The site file's, which the site's gateway speaks for.
        routers: Where the site's routers are.
        started: The robots that may be started from the page.

    Returns:
        The names that certificates were issued to.

    Raises:
        KeysError: If the folder is another site's, or cannot be written.
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
    for name, role in _EVERY_SERVICE:
        there = principals.find(name)
        wanted = there or Entry(name=f"{name}.{site}", role=role)
        if name == Role.GATEWAY.value:
            wanted = wanted.model_copy(update={"robots": robots})
        # A bundle without an entry is what was killed here before it wrote the list.
        if wanted.revoked is None and (wanted != there or not folder.service(name).is_file()):
            principals = issued(folder, principals, wanted)
            made.append(wanted.name)
    save(folder, principals)
    return tuple(made)


def entitled(folder: Folder) -> frozenset[str]:
    """The robots that gateways of robots started from the page may speak for.

    Raises:
        KeysError: If there is no list, or it is wrong.
    """
    entry = principals_of(folder).find(STARTED)
    return frozenset(entry.robots or () if entry is not None else ())


@alone
def entitle(folder: Folder, started: Sequence[str]) -> None:
    """Let the gateways of robots that are started from the page speak for these, and for no other.

    Raises:
        KeysError: If there is no list, or it cannot be written.
    """
    _entitle(folder, started)


def _entitle(folder: Folder, started: Sequence[str]) -> None:
    principals = principals_of(folder)
    entry = principals.find(STARTED)
    robots = tuple(sorted(started))
    if entry is not None and entry.robots != robots:
        save(folder, principals.replaced(entry.model_copy(update={"robots": robots})))


@alone
def issue(
    folder: Folder, name: str, role: Role, *, robots: Sequence[str] | None = None, lives: timedelta = LIVES
) -> Entry:
    """A certificate for a person, a service, or another router or gateway of the site.

    Raises:
        KeysError: If the name cannot be, or not for that role, is taken by somebody else, or was revoked and
            its certificate has not expired.
    """
    principals = principals_of(folder)
    name = name.removesuffix("." + principals.site)
    full = f"{name}.{principals.site}"
    if folder.service(name) == folder.authority:
        raise KeysError(f"{full} is the authority itself, and its file the authority's: take another name")
    if role is Role.ROUTER and name.partition("-")[0] != Role.ROUTER.value:
        raise KeysError(f"{full}: other sites know a router by its name: router-2 and router-3 are right")
    there = principals.find(full)
    if there is not None and there.role is not role and there.revoked is None:
        raise KeysError(
            f"{full} is {there.role.value} already: names are unique; take another, as "
            f"{_another(principals, there)}"
        )
    if robots is not None and role is not Role.GATEWAY:
        raise KeysError(f"--robots is for gateways: {full} would be {role.value}")
    if robots is None and role is Role.GATEWAY:
        raise KeysError(f"{full}: which robots does this gateway speak for? --robots a,b")
    if there is not None:
        _check_free(principals, there)
    entry = _entry(name=full, role=role, robots=None if robots is None else tuple(robots))
    principals = issued(folder, principals, entry, lives)
    save(folder, principals)
    found = principals.find(full)
    assert found is not None
    return found


@alone
def issue_guest(folder: Folder, site: str, *, sites: Sequence[str] = (), lives: timedelta = LIVES) -> Entry:
    """A certificate that lets another site's router in.

    Args:
        sites: Those that it speaks for; its own unless given; `*`: all but ours (a hub).

    Raises:
        KeysError: If it cannot be, or was revoked and its certificate has not expired.
    """
    principals = principals_of(folder)
    _other(principals, site)
    if (there := principals.find(f"router.{site}")) is not None:
        _check_free(principals, there)
    entry = _entry(name=f"router.{site}", role=Role.ROUTER, sites=tuple(sites) or (site,))
    principals = issued(folder, principals, entry, lives)
    save(folder, principals)
    found = principals.find(entry.name)
    assert found is not None
    return found


@alone
def accept(folder: Folder, data: bytes, *, sites: Sequence[str] = ()) -> str:
    """Take what lets our routers in at another site; its router gets rights here, as it gives them.

    Returns:
        The other site.

    Raises:
        KeysError: If it is not such a file, not for this site, or its router was revoked here and the
            certificate that it had has not expired.
    """
    principals = principals_of(folder)
    shown = certificates.show(data)
    if shown.role != Role.ROUTER.value or shown.name.rpartition(".")[2] != principals.site:
        raise KeysError(
            f"it lets {shown.name} ({shown.role}) in at site {shown.authority}: for this site "
            f"robomesh keys issue --guest {principals.site} is right there"
        )
    if shown.expires <= now():
        raise KeysError(f"it expired on {shown.expires:%Y-%m-%d %H:%M} UTC: site {shown.authority} renews it")
    _other(principals, shown.authority)
    name = f"router.{shown.authority}"
    there = principals.find(name)
    if there is not None:
        _check_free(principals, there)
    if there is None or there.revoked is not None or sites:
        entry = _entry(name=name, role=Role.ROUTER, sites=tuple(sites) or (shown.authority,))
        if there is not None:
            kept = {"serial": there.serial, "fingerprint": there.fingerprint, "earlier": there.earlier}
            entry = entry.model_copy(update={**kept, "issued": there.issued, "expires": there.expires})
        principals = principals.replaced(entry)
    write(folder.link(shown.authority), data)
    save(folder, principals)
    return shown.authority


@alone
def revoke(folder: Folder, name: str) -> Entry:
    """Take a name off the routers' list; they drop whoever is there under it.

    Raises:
        KeysError: If there is nobody of that name.
    """
    principals = principals_of(folder)
    entry = principals.find(name)
    if entry is None:
        raise KeysError(f"{name} has no certificate of this site: robomesh keys list shows who has")
    if entry.revoked is None:
        entry = entry.model_copy(update={"revoked": now()})
    save(folder, principals.replaced(entry))
    return entry


def rules_of(principals: Principals) -> str:
    """The text of the routers' file."""
    sections = access_sections(principals.site, principals.allowed, principals.border)
    return (
        f"// What everybody may do at site {principals.site}: robomesh keys writes it from principals.toml.\n"
        + json.dumps(sections, indent=1)
        + "\n"
    )


def file_of(folder: Folder, site: str, entry: Entry) -> str:
    """Where somebody's bundle lies."""
    name, _, of = entry.name.rpartition(".")
    if of != site:
        return str(folder.guest(of))
    return str(folder.person(name) if entry.role in PEOPLE else folder.service(name))


def _entry(**values: object) -> Entry:
    try:
        return Entry.model_validate(values)
    except ValueError:
        raise KeysError(
            f"{values['name']} cannot be: names are letters, digits, '_' and '-', robots and sites in lower "
            "case, beginning with a letter or digit"
        ) from None


def _other(principals: Principals, site: str) -> None:
    try:
        check_name(site, "site")
    except KeyNameError as error:
        raise KeysError(str(error)) from None
    if site == principals.site:
        raise KeysError(f"{site} is this site: another site's router is a guest")


def _check_free(principals: Principals, entry: Entry) -> None:
    """Refuse a name that was revoked while a certificate of it is good: the rules would let both in.

    Raises:
        KeysError: If it is so.
    """
    if entry.revoked is None or entry.good_until is None or entry.good_until <= now():
        return
    ours = entry.name.rpartition(".")[2] == principals.site
    instead = (
        f"issue {_another(principals, entry)} in its place"
        if ours
        else "before that, a new authority alone keeps the old one out"
    )
    raise KeysError(
        f"{entry.name} was revoked, and a certificate of that name is good until "
        f"{entry.good_until:%Y-%m-%d %H:%M} UTC: whoever has it would be let in again; {instead}"
    )


def _another(principals: Principals, entry: Entry) -> str:
    """A name that nobody has or had, made from one that somebody has."""
    name = entry.name.rpartition(".")[0]
    return next(new for n in count(2) if principals.find(new := f"{name}-{n}") is None)


def issued(folder: Folder, principals: Principals, entry: Entry, lives: timedelta = LIVES) -> Principals:
    """The list with an entry's new certificate, whose bundle is written."""
    if not folder.authority_key.is_file():
        raise KeysError(
            f"{folder.authority_key} is not there: the authority's key signs; bring it back for this"
        )
    authority = certificates.read_authority(read(folder.authority_key), read(folder.authority))
    ours = entry.name.rpartition(".")[2] == principals.site
    made = certificates.issue(
        authority,
        entry.name,
        entry.role.value,
        now=now(),
        lives=lives,
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
    told = {
        "earlier": None if before is None else before.good_until,
        "serial": made.serial,
        "fingerprint": made.fingerprint,
        "issued": made.issued,
        "expires": made.expires,
        "revoked": None,
    }
    return principals.replaced(entry.model_copy(update=told))


def save(folder: Folder, principals: Principals) -> None:
    """Write the list, and the routers' rules where they have changed."""
    write(folder.principals, write_principals(principals).encode())
    rules = rules_of(principals).encode()
    # A router reloads when it changes: renewed certificates alone are no reason.
    if not folder.access.is_file() or read(folder.access) != rules:
        write(folder.access, rules)
