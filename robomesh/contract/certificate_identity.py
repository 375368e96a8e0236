"""Identity lines at the head of a certificate's file.

A certificate of the mesh comes as one file, a bundle: these lines, the private key, the certificate and
the authority's certificate. The lines repeat the certificate's contents for people and for error texts;
a router trusts only the certificate.

    Name: li.shanghai
    Role: operator
    Expires: 2026-12-21T08:00:00Z
    Robots: pt600-1, pt600-2            of a gateway; without this line only the routers know them
    Routers: tls/10.0.0.1:7447          addresses of the site's routers
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from robomesh.contract.topic_schema import Role
from robomesh.errors import SessionError
from robomesh.texts import split_commas

_BEGIN = "-----BEGIN"
_MOST_BYTES = 1 << 18


@dataclass(frozen=True, kw_only=True)
class Identity:
    """The owner of a certificate, as the lines in its file describe it.

    Attributes:
        name: The certificate's common name, <name>.<site>.
        expires: In UTC; None: not in the file.
        robots: The robots of a gateway; None: not in the file.
        routers: Addresses of the site's routers.
    """

    name: str
    role: Role
    expires: datetime | None = None
    robots: frozenset[str] | None = None
    routers: tuple[str, ...] = ()

    @property
    def site(self) -> str:
        """Site of the authority that issued the certificate."""
        return self.name.rpartition(".")[2]


def header(identity: Identity) -> str:
    """Return the lines for the head of a bundle."""
    lines = [f"Name: {identity.name}", f"Role: {identity.role.value}"]
    if identity.expires is not None:
        lines.append(f"Expires: {identity.expires.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}")
    if identity.robots is not None:
        lines.append(f"Robots: {', '.join(sorted(identity.robots))}")
    if identity.routers:
        lines.append(f"Routers: {', '.join(identity.routers)}")
    return "\n".join([*lines, "", ""])


def read_identity(path: Path) -> Identity | None:
    """Return the identity in a certificate's file; None: a file without these lines, from other tools.

    Raises:
        SessionError: If the file cannot be read, or holds no certificate and no key.
    """
    try:
        with path.open("rb") as file:
            text = file.read(_MOST_BYTES).decode(errors="replace")
    except OSError as error:
        raise SessionError(f"{path}: cannot be read: {error.strerror}") from None
    if _BEGIN not in text:
        raise SessionError(f"{path} holds no certificate and no key: name a bundle that robomesh keys wrote")
    lines = dict(line.partition(": ")[::2] for line in text.split(_BEGIN, 1)[0].splitlines())
    try:
        return Identity(
            name=lines["Name"],
            role=Role(lines["Role"]),
            expires=datetime.fromisoformat(lines["Expires"]).astimezone(UTC) if "Expires" in lines else None,
            robots=frozenset(split_commas(lines["Robots"])) if "Robots" in lines else None,
            routers=split_commas(lines.get("Routers", "")),
        )
    except (KeyError, ValueError):
        return None
