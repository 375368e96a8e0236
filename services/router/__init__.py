"""A site's router: every service and monitor of the site is its client; sites link router to router."""

from services.router.router import Settings, serve, write_config

__all__ = ["Settings", "serve", "write_config"]
