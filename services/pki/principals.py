"""A site's principals, the names that have a certificate: a TOML file that people can read and edit."""

import tomllib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Annotated

from pydantic import AwareDatetime, Field, ValidationError

from robomesh.contract.access_rights import Border, Principal
from robomesh.contract.topics import Role
from robots.schema.bounded_toml import parse_toml
from robots.schema.toml_table import TomlTable
from services.pki.errors import KeysError

_NAME = r"^[A-Za-z0-9][A-Za-z0-9_-]*\.[a-z0-9][a-z0-9_-]*$"
_SITE = r"^([a-z0-9][a-z0-9_-]*|\*)$"
_ROBOT = r"^[a-z0-9][a-z0-9_-]*$"
Site = Annotated[str, Field(pattern=_SITE)]
Robot = Annotated[str, Field(pattern=_ROBOT)]


class Entry(TomlTable):
    """A principal: a name that has, or had, a certificate.

    Attributes:
        robots: Robots that a gateway may publish for.
        sites: Sites that another site's router may publish for; `*`: all but this one.
        serial: Empty if another site's authority issued the certificate.
        earlier: Latest expiry among the name's earlier certificates.
    """

    name: Annotated[str, Field(pattern=_NAME)]
    role: Role
    robots: tuple[Robot, ...] | None = None
    sites: tuple[Site, ...] = ()
    serial: str = ""
    fingerprint: str = ""
    # With a time zone, because people may edit the file.
    issued: AwareDatetime | None = None
    expires: AwareDatetime | None = None
    earlier: AwareDatetime | None = None
    revoked: AwareDatetime | None = None

    @property
    def good_until(self) -> datetime | None:
        """Latest expiry of all the name's certificates; None if this site issued none."""
        return max((end for end in (self.expires, self.earlier) if end is not None), default=None)

    @property
    def own_robots(self) -> frozenset[str] | None:
        """The robots that a gateway may publish for; None for other roles."""
        return frozenset(self.robots or ()) if self.role is Role.GATEWAY else None

    @property
    def principal(self) -> Principal:
        """The principal as the access rules take it."""
        return Principal(name=self.name, role=self.role, robots=self.own_robots, sites=self.sites)


class _List(TomlTable):
    site: Annotated[str, Field(pattern=_ROBOT)]
    border: Border = "open"
    routers: tuple[str, ...] = ()
    principal: tuple[Entry, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Principals:
    """All principals of a site.

    Attributes:
        routers: Addresses of the site's routers, for bundles that are handed over.
    """

    site: str
    border: Border = "open"
    routers: tuple[str, ...] = ()
    entries: tuple[Entry, ...] = ()

    def find(self, name: str) -> Entry | None:
        """Return the entry of a name, given with or without its site; None if there is none."""
        full = name if "." in name else f"{name}.{self.site}"
        return next((entry for entry in self.entries if entry.name == full), None)

    def replaced(self, entry: Entry) -> "Principals":
        """Return the list with an entry added, in place of the one with its name."""
        others = [each for each in self.entries if each.name != entry.name]
        return Principals(
            site=self.site,
            border=self.border,
            routers=self.routers,
            entries=tuple(sorted([*others, entry], key=lambda each: each.name)),
        )

    @property
    def allowed(self) -> tuple[Principal, ...]:
        """The principals that are not revoked."""
        return tuple(entry.principal for entry in self.entries if entry.revoked is None)


def read_principals(text: str, where: str) -> Principals:
    """Parse the list from a file's text.

    Raises:
        KeysError: If it is invalid; the message names the file, the key and the problem.
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
            raise KeysError(f"{where}: {name} is listed twice: every name needs one entry")
    return Principals(
        site=listed.site, border=listed.border, routers=listed.routers, entries=listed.principal
    )


def write_principals(principals: Principals) -> str:
    """Return the list as a file's text."""
    # Names contain no character that TOML would escape.
    lines = [
        f"# Principals of site {principals.site}. robomesh keys writes this file, and from it",
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
