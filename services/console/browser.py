"""One browser on the page's WebSocket: what it watches goes down, what it asks goes up.

A slow browser slows nobody: its lanes keep the newest, and it is sent what fits its line.
"""

import asyncio
import logging
import time
from collections import deque
from collections.abc import Coroutine
from typing import Any

from google.protobuf.message import DecodeError
from starlette.websockets import WebSocket, WebSocketDisconnect

from bus import keys, topics
from bus.errors import BusError, NoAnswerError, RefusedError
from bus.header import pack
from bus.schemas.robomesh_pb2 import FromPage, KeyFrameRequest, ToPage
from bus.session import Session
from bus.subscription import Sample
from services.console.errors import WatchError
from services.console.feeds import Feeds
from services.console.lanes import Lane, VideoLane, lane_for

log = logging.getLogger(__name__)

_MOST_WATCHES = 1024
_MOST_ASKS = 64
_LONGEST_ASK_S = 10.0
_KEY_FRAME_EACH_S = 1.0
_POLICY_VIOLATION = 1008


class Browser:
    """A browser's watches, lanes and questions."""

    def __init__(self, session: Session, feeds: Feeds) -> None:
        self._session = session
        self._feeds = feeds
        self._watches: set[str] = set()
        self._lanes: dict[str, Lane] = {}
        self._video: dict[str, VideoLane] = {}
        self._key_frame_asked: dict[str, float] = {}
        self._messages: deque[ToPage] = deque()
        self._asks: set[asyncio.Task[None]] = set()
        self._wake = asyncio.Event()

    def tell(self, message: ToPage) -> None:
        """Sends a message before any sample: greetings, answers, presence."""
        self._messages.append(message)
        self._wake.set()

    async def run(self, websocket: WebSocket) -> None:
        """Serves it until it goes."""
        sending = asyncio.create_task(self._send(websocket))
        try:
            await self._receive(websocket)
        except WebSocketDisconnect:
            pass
        except (WatchError, DecodeError) as error:
            log.warning("a browser was cut off: %s", error)
            await websocket.close(_POLICY_VIOLATION, str(error)[:120])
        finally:
            for expression in self._watches:
                self._feeds.leave(expression, self._offer)
            for task in (sending, *self._asks):
                task.cancel()
            await asyncio.gather(sending, *self._asks, return_exceptions=True)

    async def _receive(self, websocket: WebSocket) -> None:
        while True:
            message = FromPage.FromString(await websocket.receive_bytes())
            match message.WhichOneof("message"):
                case "watch":
                    self._watch(message.watch.key)
                case "unwatch":
                    self._unwatch(message.unwatch.key)
                case "ask":
                    self._ask(message.ask)

    def _watch(self, expression: str) -> None:
        if expression in self._watches:
            return
        if len(self._watches) >= _MOST_WATCHES:
            raise WatchError(f"more than {_MOST_WATCHES} keys watched by one page")
        self._feeds.join(expression, self._offer)
        self._watches.add(expression)

    def _unwatch(self, expression: str) -> None:
        if expression in self._watches:
            self._watches.discard(expression)
            self._feeds.leave(expression, self._offer)
            # A later watch of the same video must begin with a key frame again.
            self._lanes.pop(expression, None)
            self._video.pop(expression, None)

    def _offer(self, sample: Sample) -> None:
        lane = self._lanes.get(sample.key) or self._video.get(sample.key)
        if lane is None:
            lane = lane_for(topics.topic(sample.parsed.topic))
            if isinstance(lane, VideoLane):
                self._video[sample.key] = lane
            else:
                self._lanes[sample.key] = lane
        lane.push(sample)
        if isinstance(lane, VideoLane) and lane.starved:
            self._want_key_frame(sample.key)
        self._wake.set()

    async def _send(self, websocket: WebSocket) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            while await self._send_round(websocket):
                pass

    async def _send_round(self, websocket: WebSocket) -> bool:
        """Sends all messages, then one sample of each key, state before video; whether there was any."""
        sent = False
        for lanes in (self._lanes, self._video):
            for lane in tuple(lanes.values()):
                while self._messages:
                    await websocket.send_bytes(self._messages.popleft().SerializeToString())
                sample = lane.pop()
                if sample is not None:
                    await websocket.send_bytes(sample_bytes(sample))
                    sent = True
        while self._messages:
            await websocket.send_bytes(self._messages.popleft().SerializeToString())
        return sent

    def _want_key_frame(self, key: str) -> None:
        now = time.monotonic()
        if now - self._key_frame_asked.get(key, -_KEY_FRAME_EACH_S) < _KEY_FRAME_EACH_S:
            return
        self._key_frame_asked[key] = now

        async def ask() -> None:
            try:
                await self._session.ask(f"{key}/keyframe", KeyFrameRequest())
            except BusError as error:
                log.debug("no key frame on %s: %s", key, error)

        self._keep(ask())

    def _ask(self, ask: FromPage.Ask) -> None:
        if len(self._asks) >= _MOST_ASKS and not ask.key.endswith("/stop"):
            self.tell(refusal(ask.id, f"more than {_MOST_ASKS} requests wait for an answer: try again later"))
        else:
            self._keep(self._answer(ask))

    async def _answer(self, ask: FromPage.Ask) -> None:
        try:
            check_ask(ask.key)
            payload = await self._session.ask_bytes(
                ask.key, ask.payload, timeout_s=min(ask.timeout_s or 2.0, _LONGEST_ASK_S)
            )
        except (RefusedError, NoAnswerError) as error:
            self.tell(refusal(ask.id, str(error)))
        else:
            self.tell(ToPage(answer=ToPage.Answer(id=ask.id, ok=True, payload=payload)))

    def _keep(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._asks.add(task)
        task.add_done_callback(self._asks.discard)


def check_ask(key: str) -> None:
    """Passes a key that a page may ask on.

    Raises:
        RefusedError: If it is no request of the table, or has a wildcard.
    """
    try:
        parsed = keys.parse_key(key)
        keys.check_name(parsed.site, "site")
        if parsed.robot != keys.WHOLE_SITE:
            keys.check_name(parsed.robot, "robot")
        row = topics.request(parsed.topic)
        for chunk in parsed.topic.split("/"):
            keys.check_chunk(chunk)
    except BusError as error:
        raise RefusedError(str(error)) from None
    if topics.Role.CONSOLE not in row.askers:
        raise RefusedError(f"the console has no right to ask {row.name}")


def refusal(ask_id: int, text: str) -> ToPage:
    """An answer that says why not."""
    return ToPage(answer=ToPage.Answer(id=ask_id, ok=False, error=text))


def sample_bytes(sample: Sample) -> bytes:
    """A sample for the page, its payload and attachment as they were, with its age where it is known."""
    message = ToPage.Sample(
        key=sample.key, attachment=pack(sample.header), payload=sample.payload, live=sample.live
    )
    if sample.live:
        message.age_s = time.monotonic() - sample.received
    return ToPage(sample=message).SerializeToString()
