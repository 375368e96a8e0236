"""The site file's `[console]`."""

from pathlib import Path

from pydantic import BaseModel, StrictBool

from services.site_file.part import PART_CONFIG


class ConsoleTls(BaseModel):
    """The page's certificate.

    Attributes:
        certificate: File of the certificate with its chain (PEM).
        key: File of its private key (PEM).
    """

    model_config = PART_CONFIG
    certificate: Path
    key: Path


class Console(BaseModel):
    """The console: the service that serves the page.

    Attributes:
        listen: Address of the page. Beyond loopback it needs `accounts` and `tls`.
        hosts: Host names of the page, in addition to IP addresses and localhost.
        accounts: File of accounts (`robomesh accounts`); absent: the page needs no sign-in.
        tls: The page's certificate; absent: HTTP.
        insecure: Accept an address that other machines reach without accounts or TLS.
    """

    model_config = PART_CONFIG
    listen: str = "127.0.0.1:8080"
    hosts: tuple[str, ...] = ()
    accounts: Path | None = None
    tls: ConsoleTls | None = None
    insecure: StrictBool = False

    @property
    def scheme(self) -> str:
        """Scheme of the page's address."""
        return "https" if self.tls is not None else "http"


def resolve_paths(console: Console, folder: Path) -> Console:
    """Return the part with paths relative to the site file's folder."""
    changes: dict[str, object] = {}
    if console.accounts is not None:
        changes["accounts"] = folder / console.accounts
    if console.tls is not None:
        files = {"certificate": folder / console.tls.certificate, "key": folder / console.tls.key}
        changes["tls"] = ConsoleTls.model_validate(files)
    return console.model_copy(update=changes)
