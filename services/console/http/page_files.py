"""Files of the built page, with caching headers; hashed assets are compressed once."""

import asyncio
import functools
import gzip
from pathlib import Path

from starlette.datastructures import Headers
from starlette.responses import FileResponse, Response
from starlette.staticfiles import StaticFiles
from starlette.types import Scope

_MOST_FILES = 256
_SMALLEST, _LEVEL = 1024, 6


class PageFiles(StaticFiles):
    """The built page; browsers may cache hashed assets, and fetch the rest each time."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        """Return a file with its caching headers."""
        response = await super().get_response(path, scope)
        hashed = path.startswith("assets/") and response.status_code == 200
        response.headers["Cache-Control"] = "public, max-age=31536000, immutable" if hashed else "no-store"
        headers = Headers(scope=scope)
        if not (
            hashed
            and isinstance(response, FileResponse)
            and scope["method"] == "GET"
            and "range" not in headers
            and "gzip" in headers.get("accept-encoding", "")
            and int(response.headers["Content-Length"]) >= _SMALLEST
        ):
            return response
        # Compressing the answers to a flood of requests in the event loop would delay a page's stop.
        packed = await asyncio.to_thread(_compressed, Path(response.path))
        kept = {name: value for name, value in response.headers.items() if name != "content-length"}
        added = {"Content-Encoding": "gzip", "Vary": "Accept-Encoding"}
        return Response(packed, headers=kept | added)


@functools.lru_cache(_MOST_FILES)
def _compressed(path: Path) -> bytes:
    return gzip.compress(path.read_bytes(), _LEVEL, mtime=0)
