"""Settings of Define's server."""

from dataclasses import dataclass, field
from pathlib import Path

from robots.descriptions.glb import cache_folder
from services.console.define.worker_pool import Limits
from services.site_file.site import Site


def _store_folder() -> Path:
    return cache_folder().parent / "define"


@dataclass(frozen=True, kw_only=True)
class DefineSettings:
    """Folder of saved robots, and limits of drafts.

    Attributes:
        site: The site; `site.define.folder` has its saved robots.
        can_start: A supervisor starts robots (`robomesh up`).
        store: Folder for the files of drafts.
        most_file_bytes: Largest file.
        most_json_bytes: Largest request.
    """

    site: Site
    can_start: bool = False
    store: Path = field(default_factory=_store_folder)
    limits: Limits = field(default_factory=Limits)
    most_file_bytes: int = 200 * 1000**2
    most_json_bytes: int = 4 * 1000**2
