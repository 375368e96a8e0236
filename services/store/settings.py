"""The site file's `[programs]`, and the settings of the service, which add what it knows of the site."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from robomesh.contract.quotas import DEFAULT_QUOTAS, Quotas
from robots.schema.toml_table import TomlTable

MIB = 1 << 20


class Programs(TomlTable):
    """Programs and notes that the site stores.

    Attributes:
        folder: Folder of the programs and notes.
        most_mib: Quota of all saved versions [MiB].
        runs_mib: Space for programs that ran without being saved; the oldest make room [MiB].
        notes_mib: Quota of all notes; none is ever removed [MiB].
    """

    folder: Path = Path("programs")
    most_mib: Annotated[float, Field(ge=1, le=4096)] = 64
    runs_mib: Annotated[float, Field(ge=1, le=4096)] = 16
    notes_mib: Annotated[float, Field(ge=1, le=256)] = 16


class Settings(Programs):
    """A site's programs and notes; each site has a folder in `folder`.

    Attributes:
        robots: The site file's robots; a robot that is started from the page is found by its gateway.
        quotas: Quotas of each client.
    """

    site: str
    robots: tuple[str, ...] = ()
    quotas: Quotas = DEFAULT_QUOTAS
