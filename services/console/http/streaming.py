"""A streaming response with a time limit for its reader."""

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping

from starlette.responses import StreamingResponse
from starlette.types import Message, Send

log = logging.getLogger(__name__)


class Streamed(StreamingResponse):
    """A response that sends each piece after the one before has left."""

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
        """Prepare the response.

        Args:
            on_end: Called once, also if the generator never starts.
            within_s: The stream ends if its reader takes nothing for this long [s].
        """
        super().__init__(pieces, status_code=status, headers=headers, media_type=media_type)
        self._on_end, self._within_s = on_end, within_s

    async def stream_response(self, send: Send) -> None:
        """Send the pieces; stop if the reader takes none in time."""

        async def timely(message: Message) -> None:
            async with asyncio.timeout(self._within_s):
                await send(message)

        try:
            await super().stream_response(timely)
        except TimeoutError:
            log.info("a stream ended: its reader took nothing for %g s", self._within_s)
        finally:
            await self._on_end()
