"""The list of who has a certificate at a site: a TOML file that people can read, and edit in need."""

import tomllib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, ValidationError

from robomesh.access import Border, Principal
from robomesh.topics import Role
from robots.bounded_toml import parse_toml
from services.pki.errors import KeysError

_QUIET = ConfigDict(extra="forbid", frozen=True)
_NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]*\.[a-z0-9][a-z0-9_-]*$"
_SITE = r"^([a-z0-9][a-z0-9_-]*|\*)$"
_ROBOT = r"^[a-z0-9][a-z0-9_-]*$"
Site = Annotated[str, Field(pattern=_SITE)]
Robot = Annotated[str, Field(pattern=_ROBOT)]


class Entry(BaseModel):
    """One who has, or had, a certificate.

    Attributes:
        robots: A gateway's.
        sites: Of another site's router: the sites that it speaks for; `*`: any but this one.
        serial: Empty where another site's authority issued it.
        earlier: When the last of the certificates that the name had before this one expires.
    """

    model_config = _QUIET
    name: Annotated[str, Field(pattern=_NAME)]
    role: Role
    robots: tuple[Robot, ...] | None = None
    sites: tuple[Site, ...] = ()
    serial: str = ""
    fingerprint: str = ""
    # With its zone: people may edit the file.
    issued: AwareDatetime | None = None
    expires: AwareDatetime | None = None
    earlier: AwareDatetime | None = None
    revoked: AwareDatetime | None = None

    @property
    def good_until(self) -> datetime | None:
        """When the last certificate of the name expires, renewed ones too; None: we issued none."""
        return max((end for end in (self.expires, self.earlier) if end is not None), default=None)

    @property
    def own_robots(self) -> frozenset[str] | None:
        """The robots that a gateway speaks for, by their names; None: it is no gateway."""
        return frozenset(self.robots or ()) if self.role is Role.GATEWAY else None

    @property
    def principal(self) -> Principal:
        """As the rules take it."""
        return Principal(name=self.name, role=self.role, robots=self.own_robots, sites=self.sites)


class _List(BaseModel):
    model_config = _QUIET
    site: Annotated[str, Field(pattern=_ROBOT)]
    border: Border = "open"
    routers: tuple[str, ...] = ()
    principal: tuple[Entry, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Principals:
    """Everybody at a site.

    Attributes:
        routers: Where the site's routers are, for bundles that are handed over.
    """

    site: str
    border: Border = "open"
    routers: tuple[str, ...] = ()
    entries: tuple[Entry, ...] = ()

    def find(self, name: str) -> Entry | None:
        """Who has a name, with the site or without."""
        full = name if "." in name else f"{name}.{self.site}"
        return next((entry for entry in self.entries if entry.name == full), None)

    def replaced(self, entry: Entry) -> "Principals":
        """With an entry anew, in the place of the one of its name."""
        others = [each for each in self.entries if each.name != entry.name]
        return Principals(
            site=self.site,
            border=self.border,
            routers=self.routers,
            entries=tuple(sorted([*others, entry], key=lambda each: each.name)),
        )

    @property
    def allowed(self) -> tuple[Principal, ...]:
        """Those who were not revoked."""
        return tuple(entry.principal for entry in self.entries if entry.revoked is None)


def read_principals(text: str, where: str) -> Principals:
    """The list that a file holds.

    Raises:
        KeysError: With the file, the key and what is wrong with it.
    """
    try:
        listed = _List.model_validate(parse_toml(text))
    except tomllib.TOMLDecodeError as error:
        raise KeysError(f"{where}: not TOML: {error}") from None
    except ValidationError as error:
        problem = error.errors()[0]
        place = ".".join(map(str, problem["loc"]))
        raise KeysError(f"{where}: {place} = {problem['input']!r}: {problem['msg']}") from None
    for name, count in Counter(entry.name for entry in listed.principal).items():
        if count > 1:
            raise KeysError(f"{where}: {name} stands there twice: every name needs one entry")
    return Principals(
        site=listed.site, border=listed.border, routers=listed.routers, entries=listed.principal
    )


def write_principals(principals: Principals) -> str:
    """The list as a file's text."""
    # Names hold nothing that TOML would need escaped; addresses are quoted by us.
    lines = [
        f"# Who may take part at site {principals.site}. robomesh keys writes this file, and from it",
        "# access.json5, which the site's routers follow.",
        f'site = "{principals.site}"',
        f'border = "{principals.border}"',
        f"routers = {_array(principals.routers)}",
    ]
    for entry in principals.entries:
        lines += ["", "[[principal]]", f'name = "{entry.name}"', f'role = "{entry.role.value}"']
        if entry.robots is not None:
            lines.append(f"robots = {_array(entry.robots)}")
        if entry.sites:
            lines.append(f"sites = {_array(entry.sites)}")
        for key, text in (("serial", entry.serial), ("fingerprint", entry.fingerprint)):
            if text:
                lines.append(f'{key} = "{text}"')
        for key in ("issued", "expires", "earlier", "revoked"):
            if (time := getattr(entry, key)) is not None:
                lines.append(f"{key} = {time.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}")
    return "\n".join([*lines, ""])


def _array(texts: Iterable[str]) -> str:
    return "[" + ", ".join(f'"{text}"' for text in texts) + "]"
