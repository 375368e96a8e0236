"""The renderer service: its robots, the streams of their views, subscribers, rates and threads.

No pixels (`pictures`, `drawing`).
"""

from renderer.service.renderer import Settings, serve

__all__ = ["Settings", "serve"]
