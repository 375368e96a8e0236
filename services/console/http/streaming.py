"""An answer that comes piece by piece, and ends with its reader."""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping

from starlette.responses import StreamingResponse
from starlette.types import Message, Send

log = logging.getLogger(__name__)


class Streamed(StreamingResponse):
    """Pieces, each sent once the one before has left."""

    def __init__(
        self,
        pieces: AsyncIterator[bytes],
        headers: Mapping[str, str],
        *,
        on_end: Callable[[], Awaitable[None]],
        within_s: float,
        status: int = 200,
        media_type: str | None = None,
    ) -> None:
        """What is sent, and to whom it is told.

        Args:
            on_end: Called once, however it ends: a generator that was not begun tells nobody.
            within_s: Who takes nothing for so long is sent no more [s].
        """
        super().__init__(pieces, status_code=status, headers=headers, media_type=media_type)
        self._on_end, self._within_s = on_end, within_s

    async def stream_response(self, send: Send) -> None:
        """Sends what comes; breaks off where nothing leaves."""

        async def timely(message: Message) -> None:
            async with asyncio.timeout(self._within_s):
                await send(message)

        try:
            await super().stream_response(timely)
        except TimeoutError:
            log.info("a reader took nothing for %g s: it is sent no more", self._within_s)
        finally:
            await self._on_end()
