"""What Define's server is told."""

from dataclasses import dataclass, field
from pathlib import Path

from robots.glb import cache_folder
from services.console.define.worker_pool import Limits
from services.site_file.site import Site


def _store_folder() -> Path:
    return cache_folder().parent / "define"


@dataclass(frozen=True, kw_only=True)
class DefineSettings:
    """Where robots are saved, and what drafts may take.

    Attributes:
        site: Its saved robots are in `site.define.folder`.
        can_start: A supervisor follows the robots that are started (`robomesh up`).
        store: Folder for the files of drafts.
        most_file_bytes: Of one file.
        most_json_bytes: Of a request.
    """

    site: Site
    can_start: bool = False
    store: Path = field(default_factory=_store_folder)
    limits: Limits = field(default_factory=Limits)
    most_file_bytes: int = 200 * 1000**2
    most_json_bytes: int = 4 * 1000**2
