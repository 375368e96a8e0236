"""Where a site's keys lie, and how they are written: whole or not at all, and for their owner only.

authority/authority.key   signs; needed to issue and renew only, may be kept off the network
authority.pem             the authority's certificate, whom everybody of the site trusts
principals.toml           who has a certificate
access.json5              what each of them may do, for the routers
<service>.pem             a service's bundle: private key, certificate, authority's certificate
people/<name>.pem         bundles of operators and monitors, to hand over
guests/<site>.pem         what lets another site's router in here, to hand over
links/<site>.pem          what lets our routers in at another site, from there
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from robomesh.atomic_write import write_atomically
from robomesh.endpoints import Tls, bundle
from services.pki.errors import KeysError

_FOLDER_MODE = 0o700
_FILE_MODE = 0o600


@dataclass(frozen=True)
class Folder:
    """A site's folder of keys."""

    path: Path

    @property
    def authority_key(self) -> Path:
        """What signs certificates."""
        return self.path / "authority" / "authority.key"

    @property
    def authority(self) -> Path:
        """The authority's certificate."""
        return self.path / "authority.pem"

    @property
    def principals(self) -> Path:
        """The list of who has a certificate."""
        return self.path / "principals.toml"

    @property
    def access(self) -> Path:
        """What a router is told of everybody's rights."""
        return self.path / "access.json5"

    def service(self, name: str) -> Path:
        """A service's bundle."""
        return self.path / f"{name}.pem"

    def person(self, name: str) -> Path:
        """An operator's or monitor's bundle."""
        return self.path / "people" / f"{name}.pem"

    def guest(self, site: str) -> Path:
        """What another site's router is let in with."""
        return self.path / "guests" / f"{site}.pem"

    def link(self, site: str) -> Path:
        """What our routers are let in with at another site."""
        return self.path / "links" / f"{site}.pem"

    @property
    def links(self) -> tuple[str, ...]:
        """The sites whose routers let ours in."""
        return tuple(sorted(file.stem for file in (self.path / "links").glob("*.pem")))

    def tls_of(self, service: str) -> Tls:
        """A service's certificates.

        Raises:
            KeysError: If it has none here.
        """
        file = self.service(service)
        for needed in (self.authority, file):
            if not needed.is_file():
                raise KeysError(
                    f"{needed} is not there: robomesh keys init SITE.toml makes what a site's services need"
                )
        return bundle(file, self.authority)

    def tls_of_link(self, site: str) -> Tls:
        """The certificates for a link to another site's router.

        Raises:
            KeysError: If that site has not let us in.
        """
        file = self.link(site)
        if not file.is_file():
            raise KeysError(
                f"{file} is not there: robomesh keys issue --guest OURS at site {site} makes a file, "
                "and robomesh keys accept FILE takes it here"
            )
        return bundle(file)


@contextmanager
def locked(folder: Folder, *, make: bool = False) -> Iterator[None]:
    """Alone in a folder while the block runs: who reads the list and writes it anew loses nothing of another.

    Args:
        make: Make the folder where there is none.

    Raises:
        KeysError: If it is not there, or cannot be written.
    """
    try:
        if make:
            _make(folder.path)
        lock = os.open(folder.path / ".lock", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, _FILE_MODE)
    except FileNotFoundError:
        raise KeysError(
            f"{folder.path} is not there: robomesh keys init SITE.toml begins, and --folder says where the "
            "keys lie"
        ) from None
    except OSError as error:
        raise KeysError(f"{folder.path}: cannot be written: {error.strerror}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def write(path: Path, data: bytes) -> None:
    """Write a file in one step, readable by its owner only; so is its folder, when it is new.

    Raises:
        KeysError: If it cannot be written.
    """
    try:
        _make(path.parent)
        write_atomically(path, data)
    except OSError as error:
        raise KeysError(f"{path}: cannot be written: {error.strerror}") from None


def read(path: Path) -> bytes:
    """A file's bytes.

    Raises:
        KeysError: If it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise KeysError(f"{path}: cannot be read: {error.strerror}") from None


def _make(folder: Path) -> None:
    for each in (*reversed(folder.parents), folder):
        if not each.exists():
            each.mkdir(mode=_FOLDER_MODE, exist_ok=True)
