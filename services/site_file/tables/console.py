"""The site file's `[console]`."""

import re
from pathlib import Path

from pydantic import StrictBool, field_validator

from robomesh.listen_address import split_address
from robots.schema.toml_table import TomlTable

_ORIGIN = re.compile(r"https?://(?:[a-z0-9.-]+|\[[0-9a-f:]+\])(?::\d{1,5})?")


class ConsoleTls(TomlTable):
    """The page's certificate.

    Attributes:
        certificate: File of the certificate with its chain (PEM).
        key: File of its private key (PEM).
    """

    certificate: Path
    key: Path


class Console(TomlTable):
    """The console: the service that serves the page.

    Attributes:
        listen: Address of the page. Beyond loopback it needs `accounts` and `tls`.
        hosts: Host names of the page, in addition to IP addresses and localhost.
        accounts: File of accounts (`robomesh accounts`); absent: the page needs no sign-in.
        tls: The page's certificate; absent: HTTP.
        insecure: Accept an address that other machines reach without accounts or TLS.
        embed: Origins ("https://intranet.example") whose pages may show pictures, video, and pages of single
            views, which have no controls; never the page itself. With `accounts` they need a token
            (`robomesh accounts tokens`): other pages' requests carry no sign-in.
    """

    listen: str = "127.0.0.1:8080"
    hosts: tuple[str, ...] = ()
    accounts: Path | None = None
    tls: ConsoleTls | None = None
    insecure: StrictBool = False
    embed: tuple[str, ...] = ()

    @field_validator("embed")
    @classmethod
    def _are_origins(cls, origins: tuple[str, ...]) -> tuple[str, ...]:
        for origin in origins:
            if not _ORIGIN.fullmatch(origin):
                raise ValueError(
                    f"{origin!r} is not an origin: https://HOST or https://HOST:PORT, in lower case"
                )
        return origins

    @property
    def url(self) -> str:
        """Address of the page, seen from the same machine if it listens on all addresses."""
        host, port = split_address(self.listen)
        host = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        scheme = "http" if self.tls is None else "https"
        return f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}/"


def resolve_paths(console: Console, folder: Path) -> Console:
    """Return the part with paths relative to the site file's folder."""
    changes: dict[str, object] = {}
    if console.accounts is not None:
        changes["accounts"] = folder / console.accounts
    if console.tls is not None:
        files = {"certificate": folder / console.tls.certificate, "key": folder / console.tls.key}
        changes["tls"] = ConsoleTls.model_validate(files)
    return console.model_copy(update=changes)
