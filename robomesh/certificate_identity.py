"""Who a certificate speaks for: the lines that stand above it in its file.

A certificate of the mesh comes as one file, a bundle: these lines, its private key, the certificate and
the authority's. The lines say for people, and for refusals in words, what the certificate itself says;
a router believes the certificate only.

    Name: li.shanghai
    Role: operator
    Expires: 2026-12-21T08:00:00Z
    Robots: pt600-1, pt600-2            a gateway's, and only those; without the line only the routers know
    Routers: tls/10.0.0.1:7447          where the site's routers are
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from robomesh.errors import SessionError
from robomesh.topic_schema import Role

_BEGIN = "-----BEGIN"
_MOST_BYTES = 1 << 18


@dataclass(frozen=True, kw_only=True)
class Identity:
    """Who a certificate speaks for.

    Attributes:
        name: The certificate's common name, <name>.<site>.
        expires: In UTC; None: the file does not say.
        robots: Those that a gateway speaks for; None: the file does not say.
        routers: Where the site's routers are.
    """

    name: str
    role: Role
    expires: datetime | None = None
    robots: frozenset[str] | None = None
    routers: tuple[str, ...] = ()

    @property
    def site(self) -> str:
        """The site whose authority issued it."""
        return self.name.rpartition(".")[2]


def header(identity: Identity) -> str:
    """The lines for the head of a bundle."""
    lines = [f"Name: {identity.name}", f"Role: {identity.role.value}"]
    if identity.expires is not None:
        lines.append(f"Expires: {identity.expires.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}")
    if identity.robots is not None:
        lines.append(f"Robots: {', '.join(sorted(identity.robots))}")
    if identity.routers:
        lines.append(f"Routers: {', '.join(identity.routers)}")
    return "\n".join([*lines, "", ""])


def read_identity(path: Path) -> Identity | None:
    """Who a file's certificate speaks for; None: it has no such lines, as certificates made elsewhere.

    Raises:
        SessionError: If it cannot be read.
    """
    try:
        with path.open("rb") as file:
            text = file.read(_MOST_BYTES).decode(errors="replace")
    except OSError as error:
        raise SessionError(f"{path}: cannot be read: {error.strerror}") from None
    if _BEGIN not in text:
        raise SessionError(
            f"{path} holds no certificate and no key: a bundle that robomesh keys wrote is right"
        )
    lines = dict(line.partition(": ")[::2] for line in text.split(_BEGIN, 1)[0].splitlines())
    try:
        return Identity(
            name=lines["Name"],
            role=Role(lines["Role"]),
            expires=datetime.fromisoformat(lines["Expires"]) if "Expires" in lines else None,
            robots=frozenset(_listed(lines["Robots"])) if "Robots" in lines else None,
            routers=_listed(lines.get("Routers", "")),
        )
    except (KeyError, ValueError):
        return None


def _listed(text: str) -> tuple[str, ...]:
    return tuple(part for each in text.split(",") if (part := each.strip()))
