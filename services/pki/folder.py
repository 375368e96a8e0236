"""The files of a site's keys; each is written atomically and readable by its owner only.

authority/authority.key   signs; needed to issue and renew only, may be kept off the network
authority.pem             the authority's certificate, which every client of the site trusts
principals.toml           the principals: names that have a certificate
access.json5              the principals' rights, for the routers
<service>.pem             a service's bundle: private key, certificate, authority's certificate
people/<name>.pem         bundles of operators and monitors, to hand over
guests/<site>.pem         bundles with which other sites' routers connect here, to hand over
links/<site>.pem          bundles from other sites, with which this site's routers connect there
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from robomesh.contract.endpoints import Tls, bundle
from robomesh.files.atomic_write import write_atomically
from services.pki.errors import KeysError

_FOLDER_MODE = 0o700
_FILE_MODE = 0o600


@dataclass(frozen=True)
class Folder:
    """A site's folder of keys."""

    path: Path

    @property
    def authority_key(self) -> Path:
        """The key that signs certificates."""
        return self.path / "authority" / "authority.key"

    @property
    def authority(self) -> Path:
        """The authority's certificate."""
        return self.path / "authority.pem"

    @property
    def principals(self) -> Path:
        """The list of principals."""
        return self.path / "principals.toml"

    @property
    def access(self) -> Path:
        """The access rules of the routers."""
        return self.path / "access.json5"

    def service(self, name: str) -> Path:
        """Return the path of a service's bundle."""
        return self.path / f"{name}.pem"

    def person(self, name: str) -> Path:
        """Return the path of an operator's or monitor's bundle."""
        return self.path / "people" / f"{name}.pem"

    def guest(self, site: str) -> Path:
        """Return the path of the bundle with which another site's router connects to this site."""
        return self.path / "guests" / f"{site}.pem"

    def link(self, site: str) -> Path:
        """Return the path of the bundle with which this site's routers connect to another site."""
        return self.path / "links" / f"{site}.pem"

    @property
    def links(self) -> tuple[str, ...]:
        """The sites that accept this site's routers."""
        return tuple(sorted(file.stem for file in (self.path / "links").glob("*.pem")))

    def tls_of(self, service: str) -> Tls:
        """Return a service's certificates.

        Raises:
            KeysError: If a file is missing.
        """
        file = self.service(service)
        for needed in (self.authority, file):
            if not needed.is_file():
                raise KeysError(
                    f"{needed} does not exist: robomesh keys init SITE.toml makes the services' files"
                )
        return bundle(file, self.authority)

    def tls_of_link(self, site: str) -> Tls:
        """Return the certificates for a link to another site's router.

        Raises:
            KeysError: If that site has not accepted this one.
        """
        file = self.link(site)
        if not file.is_file():
            raise KeysError(
                f"{file} does not exist: robomesh keys issue --guest OURS at site {site} makes a file, "
                "and robomesh keys accept FILE takes it here"
            )
        return bundle(file)


@contextmanager
def locked(folder: Folder, *, make: bool = False) -> Iterator[None]:
    """Hold an exclusive lock on the folder, so that a read-modify-write of the list loses no change.

    Args:
        make: Make the folder if it is missing.

    Raises:
        KeysError: If the folder does not exist or cannot be written.
    """
    try:
        if make:
            _make(folder.path)
        lock = os.open(folder.path / ".lock", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, _FILE_MODE)
    except FileNotFoundError:
        raise KeysError(
            f"{folder.path} does not exist: robomesh keys init SITE.toml creates it, and --folder names the "
            "folder of keys"
        ) from None
    except OSError as error:
        raise KeysError(f"{folder.path}: cannot be written: {error.strerror}") from None
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield
    finally:
        os.close(lock)


def write(path: Path, data: bytes) -> None:
    """Write a file atomically, readable by its owner only; a new folder gets the same protection.

    Raises:
        KeysError: If it cannot be written.
    """
    try:
        _make(path.parent)
        write_atomically(path, data)
    except OSError as error:
        raise KeysError(f"{path}: cannot be written: {error.strerror}") from None


def read(path: Path) -> bytes:
    """Return a file's content.

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
