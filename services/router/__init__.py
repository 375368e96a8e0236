"""A site's router: services and monitors are its clients; routers of several sites link to each other."""

from services.router.router import Settings, serve, write_config

__all__ = ["Settings", "serve", "write_config"]
