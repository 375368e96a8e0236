"""The parts of a site file that say how its router and its services meet: addresses, links, keys."""

import re
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, Field, StrictBool, ValidationError, field_validator

from robomesh.access import Border
from robomesh.certificate_identity import read_identity
from robomesh.endpoints import Link, Tls
from robomesh.errors import KeyNameError
from robomesh.keys import check_name
from robots.bounded_toml import read_toml
from services.pki import Folder
from services.pki.errors import KeysError
from services.site_file.listen_address import reachable
from services.site_file.part import Quiet

# A site's robots are at #/<site>/<robot>: one of these names would hide them behind a page.
_PAGES = ("define", "events", "program", "recordings", "settings", "wall")
# What else a site file may hold; `services/site_file/site.py` says what.
OF_OTHERS = frozenset(
    {"robot", "fixture", "recorder", "renderer", "console", "define", "audit", "watch", "quotas"}
)
# `beijing` or `beijing=tls/10.1.0.1:7447`: a site that let us in, and where it is if not where it said.
_SITE_LINK = re.compile(r"([a-z0-9][a-z0-9_-]*)(?:=(\S+))?")


class TlsFiles(BaseModel):
    """Certificates of this end (PEM), made elsewhere than by `robomesh keys`."""

    model_config = Quiet
    ca: Path
    certificate: Path
    key: Path


class Router(BaseModel):
    """The site's router.

    Attributes:
        public: Where others find it, for certificates that are handed over; where it listens unless given.
        connect: Other routers: an endpoint, or a site that let us in (`robomesh keys accept`).
        access: Who may do what; that of the site's keys unless given.
        border: `slow` lets out to other sites only what a slow line carries.
        line_mbit: What the narrowest line to another site carries [Mbit/s], so that video waits here and not
            in front of joint states; None: nobody knows.
    """

    model_config = Quiet
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
                    f"{each!r}: an endpoint is right, as in tls/10.1.0.1:7447, or a site that let us in, "
                    "as in beijing or beijing=tls/10.1.0.1:7447"
                )
        return connect


class Keys(BaseModel):
    """The site's own certificates, which `robomesh keys` makes; with them everybody takes TLS."""

    model_config = Quiet
    folder: Path | None = None


class RoutedSite(BaseModel):
    """What a site's router needs to know of its site."""

    model_config = Quiet
    site: str
    router: Router = Router()
    keys: Keys = Keys()

    @field_validator("site")
    @classmethod
    def _site(cls, name: str) -> str:
        if name in _PAGES:
            raise ValueError(f"the console has a page of that name, #/{name}: call the site something else")
        try:
            return check_name(name, "site")
        except KeyNameError as error:
            raise ValueError(str(error)) from None

    @property
    def listened(self) -> tuple[str, ...]:
        """Where the site's router listens."""
        return listened(self.router, self.keys)

    @property
    def links(self) -> tuple[Link, ...]:
        """The other routers that it links to."""
        return links(self.router, self.keys)

    def tls_of(self, service: str) -> Tls | None:
        """The certificates of one of the site's own services; None: the site has none."""
        return tls_of(self.router, self.keys, service)


def read_routed(path: Path) -> RoutedSite | None:
    """Of a site file, quickly: a router's restart has to be over before a lease ends, and robots' numbers
    take half of the time.

    Returns:
        None: not in order; `services.site_file.site.load` says in words what is wrong.
    """
    try:
        values = read_toml(path)
        site = RoutedSite.model_validate({name: values[name] for name in values.keys() - OF_OTHERS})
    except (OSError, ValueError, ValidationError):
        return None
    return site.model_copy(update=beside(site.router, site.keys, path.parent))


def beside(router: Router, keys: Keys, folder: Path) -> dict[str, BaseModel]:
    """Both with paths taken from the site file's folder."""
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
    """Where the router listens: by TLS where the site has keys."""
    return tuple(map(over_tls, router.listen)) if keys.folder is not None else router.listen


def public(router: Router, keys: Keys) -> tuple[str, ...]:
    """Where others find the site's routers."""
    return router.public or tuple(map(reachable, listened(router, keys)))


def tls_of(router: Router, keys: Keys, service: str) -> Tls | None:
    """The certificates of one of the site's services; None: the site has none.

    Raises:
        KeysError: If the site has keys, and this service has none of them.
    """
    if keys.folder is not None:
        return Folder(keys.folder).tls_of(service)
    files = router.tls
    return None if files is None else Tls(ca=files.ca, certificate=files.certificate, key=files.key)


def links(router: Router, keys: Keys) -> tuple[Link, ...]:
    """The other routers to link to, with what lets us in there.

    Raises:
        KeysError: If a site has not let us in, or does not say where it is.
    """
    return tuple(link for each in router.connect for link in _links(each, keys))


def _links(text: str, keys: Keys) -> list[Link]:
    named = _SITE_LINK.fullmatch(text)
    if named is None:
        return [Link(endpoint=text)]
    site, endpoint = named.groups()
    if keys.folder is None:
        raise KeysError(f"[router] connect = {text!r} names a site, and this one has no [keys] folder")
    tls = Folder(keys.folder).tls_of_link(site)
    if endpoint:
        return [Link(endpoint=endpoint, tls=tls, site=site)]
    identity = read_identity(tls.certificate)
    if identity is None or not identity.routers:
        raise KeysError(
            f"{tls.certificate} does not say where site {site} is: "
            f'connect = ["{site}=tls/HOST:PORT"] is right under [router]'
        )
    return [Link(endpoint=each, tls=tls, site=site) for each in identity.routers]


def over_tls(endpoint: str) -> str:
    """An endpoint with TLS."""
    return f"tls/{endpoint.removeprefix('tcp/')}" if endpoint.startswith("tcp/") else endpoint
