"""Settings of the store service."""

from dataclasses import dataclass
from pathlib import Path

from robomesh.contract.quotas import DEFAULT_QUOTAS, Quotas

MIB = 1 << 20


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A site's programs and notes.

    Attributes:
        robots: The site file's robots; a robot that is started from the page is found by its gateway.
        folder: Folder of the programs and notes; each site has a folder in it.
        most_bytes: Quota of all saved versions [bytes].
        most_run_bytes: Space for texts that ran without being saved; the oldest are removed [bytes].
        most_note_bytes: Quota of all notes [bytes].
        quotas: Quotas of each client.
    """

    site: str
    robots: tuple[str, ...] = ()
    folder: Path = Path("programs")
    most_bytes: int = 64 * MIB
    most_run_bytes: int = 16 * MIB
    most_note_bytes: int = 16 * MIB
    quotas: Quotas = DEFAULT_QUOTAS
