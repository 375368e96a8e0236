"""The store of a site: named programs with all their versions, and programs that ran without being saved."""

from services.store.service import serve
from services.store.settings import Settings

__all__ = ["Settings", "serve"]
