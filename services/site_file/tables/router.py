"""The parts of a site file on the router and its clients: addresses, links, keys."""

import re
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, StrictBool, ValidationError, field_validator

from robomesh.contract.access_rights import Border
from robomesh.contract.certificate_identity import read_identity
from robomesh.contract.endpoints import Link, Tls
from robomesh.contract.keys import check_name
from robomesh.errors import KeyNameError, ListenError
from robomesh.listen_address import reachable, split_address
from robots.schema.bounded_toml import read_toml
from robots.schema.toml_table import TomlTable
from services.pki import Folder
from services.pki.errors import KeysError

# A robot's page is #/<site>/<robot>: a site with one of these names would collide with a page of the console.
_PAGES = ("define", "events", "program", "recordings", "settings", "wall")
# The other parts of a site file; `services/site_file/site.py` has them.
OTHER_PARTS = frozenset(
    {"robot", "fixture", "recorder", "renderer", "console", "define", "audit", "watch", "programs", "quotas"}
)
# `beijing` or `beijing=tls/10.1.0.1:7447`: a site that accepts ours, and its address if it has changed.
_SITE_LINK = re.compile(r"([a-z0-9][a-z0-9_-]*)(?:=(\S+))?")


class TlsFiles(TomlTable):
    """Certificates of this end that `robomesh keys` did not make.

    Attributes:
        ca: File of the certificate authority's certificate (PEM).
        certificate: File of the certificate (PEM).
        key: File of its private key (PEM).
    """

    ca: Path
    certificate: Path
    key: Path


class Router(TomlTable):
    """The site's router.

    Attributes:
        listen: Endpoints on which the router listens. Beyond loopback they need TLS.
        public: Endpoints for other machines, which certificates contain; empty: the listening endpoints.
        connect: Other routers: an endpoint as in `tcp/10.1.0.1:7447`, a site that accepts this one
            (`robomesh keys accept`), or `SITE=ENDPOINT`.
        tls: Certificates of another authority, for a site without `[keys]`.
        access: File of access rules; absent: that of the site's keys.
        border: `slow` forwards to other sites only topics that a slow line can carry.
        line_mbit: Bandwidth of the narrowest line to another site [Mbit/s], so that video waits in this
            router's queue and not in front of joint states; absent: unknown.
        insecure: Accept an endpoint that other machines reach without TLS.
    """

    listen: Annotated[tuple[str, ...], Field(min_length=1)] = ("tcp/127.0.0.1:7447",)
    public: tuple[str, ...] = ()
    connect: tuple[str, ...] = ()
    tls: TlsFiles | None = None
    access: Path | None = None
    border: Border = "open"
    line_mbit: Annotated[float, Field(gt=0, le=100_000)] | None = None
    insecure: StrictBool = False

    @field_validator("connect")
    @classmethod
    def _connect(cls, connect: tuple[str, ...]) -> tuple[str, ...]:
        for each in connect:
            if "/" not in each.partition("=")[0] and not _SITE_LINK.fullmatch(each):
                raise ValueError(
                    f"{each!r}: must be an endpoint, as in tls/10.1.0.1:7447, or a site that accepts ours, "
                    "as in beijing or beijing=tls/10.1.0.1:7447"
                )
        return connect


class Metrics(TomlTable):
    """The metrics of the site's services for Prometheus.

    Attributes:
        listen: HOST:PORT of the router's metrics; absent: none. The other services use the next ports, in the
            order gateway, kinematics, console, recorder, player, watch, renderer, store.
    """

    listen: str | None = None

    @field_validator("listen")
    @classmethod
    def _listen(cls, listen: str | None) -> str | None:
        if listen is not None:
            try:
                split_address(listen)
            except ListenError as error:
                raise ValueError(str(error)) from None
        return listen


class Keys(TomlTable):
    """The site's own certificates, made by `robomesh keys`; with them every connection uses TLS.

    Attributes:
        folder: Folder of the certificates; absent: the site has none.
    """

    folder: Path | None = None


class RoutedSite(TomlTable):
    """The parts of a site file that its router needs.

    Attributes:
        site: Name of the site in keys: lower-case letters, digits, `-` and `_`, at most 64 characters.
        router: The router.
        keys: The site's certificates.
        metrics: Metrics for Prometheus.
    """

    site: str
    router: Router = Router()
    keys: Keys = Keys()
    metrics: Metrics = Metrics()

    @field_validator("site")
    @classmethod
    def _site(cls, name: str) -> str:
        if name in _PAGES:
            raise ValueError(f"the console has a page with that name, #/{name}: choose another name")
        try:
            return check_name(name, "site")
        except KeyNameError as error:
            raise ValueError(str(error)) from None

    @property
    def listened(self) -> tuple[str, ...]:
        """The endpoints that the site's router listens on."""
        return listened(self.router, self.keys)

    @property
    def links(self) -> tuple[Link, ...]:
        """The links to other routers."""
        return links(self.router, self.keys)

    def tls_of(self, service: str) -> Tls | None:
        """Return the certificates of one of the site's services; None if the site has none."""
        return tls_of(self.router, self.keys, service)


def read_routed(path: Path) -> RoutedSite | None:
    """Read only the router's parts of a site file.

    A router's restart must end before a lease expires, and parsing the robots takes half of the time.

    Returns:
        None if the file is invalid; `services.site_file.site.load` reports why.
    """
    try:
        values = read_toml(path)
        site = RoutedSite.model_validate({name: values[name] for name in values.keys() - OTHER_PARTS})
    except (OSError, ValueError, ValidationError):
        return None
    return site.model_copy(update=resolve_paths(site.router, site.keys, path.parent))


def resolve_paths(router: Router, keys: Keys, folder: Path) -> dict[str, BaseModel]:
    """Return both parts with paths relative to the site file's folder."""
    tls = router.tls
    if tls is not None:
        tls = TlsFiles(ca=folder / tls.ca, certificate=folder / tls.certificate, key=folder / tls.key)
    access = None if router.access is None else folder / router.access
    own = None if keys.folder is None else folder / keys.folder
    return {
        "router": router.model_copy(update={"tls": tls, "access": access}),
        "keys": keys.model_copy(update={"folder": own}),
    }


def listened(router: Router, keys: Keys) -> tuple[str, ...]:
    """Return the endpoints that the router listens on: TLS if the site has keys."""
    return tuple(map(over_tls, router.listen)) if keys.folder is not None else router.listen


def public(router: Router, keys: Keys) -> tuple[str, ...]:
    """Return the endpoints at which other machines reach the site's routers."""
    return router.public or tuple(map(reachable, listened(router, keys)))


def tls_of(router: Router, keys: Keys, service: str) -> Tls | None:
    """Return the certificates of one of the site's services; None if the site has none.

    Raises:
        KeysError: If the site has keys, but this service has none.
    """
    if keys.folder is not None:
        return Folder(keys.folder).tls_of(service)
    files = router.tls
    return None if files is None else Tls(ca=files.ca, certificate=files.certificate, key=files.key)


def links(router: Router, keys: Keys) -> tuple[Link, ...]:
    """Return the links to other routers, with the certificates for them.

    Raises:
        KeysError: If a site does not accept ours, or its address is unknown.
    """
    return tuple(link for each in router.connect for link in _links(each, keys))


def _links(text: str, keys: Keys) -> list[Link]:
    named = _SITE_LINK.fullmatch(text)
    if named is None:
        return [Link(endpoint=text)]
    site, endpoint = named.groups()
    if keys.folder is None:
        raise KeysError(f"[router] connect = {text!r} names a site, which needs a [keys] folder")
    tls = Folder(keys.folder).tls_of_link(site)
    if endpoint:
        return [Link(endpoint=endpoint, tls=tls, site=site)]
    identity = read_identity(tls.certificate)
    if identity is None or not identity.routers:
        raise KeysError(
            f"{tls.certificate} does not say where site {site} is: write "
            f'connect = ["{site}=tls/HOST:PORT"] under [router]'
        )
    return [Link(endpoint=each, tls=tls, site=site) for each in identity.routers]


def over_tls(endpoint: str) -> str:
    """Return an endpoint with TLS."""
    return f"tls/{endpoint.removeprefix('tcp/')}" if endpoint.startswith("tcp/") else endpoint
