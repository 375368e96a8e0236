"""One browser on the page's WebSocket: what it watches goes down, what it asks goes up.

A slow browser slows nobody: its lanes keep the newest, and it is sent what fits its line.
"""

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Coroutine
from typing import Any

from google.protobuf.message import DecodeError
from starlette.websockets import WebSocket, WebSocketDisconnect

from bus import keys, topics
from bus.errors import BusError, BusyError, NoAnswerError, RefusedError
from bus.schemas.robomesh_pb2 import FromPage, KeyFrameRequest, ToPage, ViewAnswer, ViewRequest
from bus.session import Session
from bus.subscription import Sample
from bus.topics import History
from services.console.accounts.rights import check_ask, check_own_name, check_right, in_own_name
from services.console.accounts.sessions import SignedIn
from services.console.errors import WatchError
from services.console.feeds import Feeds, check_expression
from services.console.lanes import Lane, lane_for
from services.console.line import send_together
from services.console.operating import OperatorPresence
from services.console.stepped import SteppedVideo
from services.console.views import Views
from services.console.wire import state_bytes, video_bytes

log = logging.getLogger(__name__)

_MOST_WATCHES = 1024
_MOST_ASKS = 64
_MOST_STOPS = 1024
_LONGEST_KEY = 200
# What waits for a page that does not read [bytes]: a large mesh's presence, and some large answers.
_MOST_UNREAD = 4 << 20
_CLOSED_WITHIN_S = 1.0
_LONGEST_ASK_S = 30.0  # a check of a program's motion
_KEY_FRAME_EACH_S = 1.0
# What is given to the line at once: on a slow one newer state must still be able to replace the rest.
_MOST_TOGETHER = 4096
_POLICY_VIOLATION = 1008


class Browser:
    """A browser's watches, lanes and questions.

    Args:
        greet: What it is told at first, and whenever that has changed.
        site: The console's own.
        who: Is signed in there; None: the console has no accounts.
        own_name: The one operator it asks as; empty: any, on a mesh that trusts its machine.

    Attributes:
        operator: Who has control through it.
    """

    def __init__(
        self,
        session: Session,
        feeds: Feeds,
        views: Views,
        *,
        greet: Callable[["Browser"], ToPage],
        site: str,
        who: SignedIn | None = None,
        own_name: str = "",
    ) -> None:
        self.operator = OperatorPresence(session)
        self.who, self.own_name = who, own_name
        # Who is nobody asks as this connection, as its page does.
        self._asker = own_name or self.operator.id
        self._greet, self._site = greet, site
        self._session = session
        self._feeds = feeds
        self._views = views
        self._watches: set[str] = set()
        self._lanes: dict[str, Lane] = {}
        # Those that have something to send.
        self._waiting: dict[str, Lane] = {}
        self._video: dict[str, SteppedVideo] = {}
        self._key_frame_asked: dict[str, float] = {}
        self._messages: deque[bytes] = deque()
        self._unread = 0
        self._cut_off = False
        self._asks: set[asyncio.Task[None]] = set()
        self._wake = asyncio.Event()
        # Samples that came for it, and that were sent; the others were overtaken by newer ones.
        self.offered = self.sent = 0
        self.greet()

    @property
    def in_control(self) -> bool:
        """Whether control was had through it, and not given back."""
        return self.operator.in_control

    def greet(self) -> None:
        """Tells it what it is told at first."""
        self.tell(self._greet(self))

    def rights_changed(self) -> None:
        """The account may do more, or less: control that it may not have ends at once."""
        if self.who is not None and not self.who.account.may_command:
            self.operator.close()
        self.greet()

    def tell(self, message: ToPage) -> None:
        """Sends a message before any sample: greetings, answers, presence; a page has to read them."""
        self._cut_off = self._cut_off or self._unread > _MOST_UNREAD
        if not self._cut_off:
            self._messages.append(message.SerializeToString())
            self._unread += len(self._messages[-1])
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
            with contextlib.suppress(TimeoutError):  # who reads nothing is not told either
                async with asyncio.timeout(_CLOSED_WITHIN_S):
                    await websocket.close(_POLICY_VIOLATION, str(error)[:120])
        finally:
            self.operator.close()
            for expression in tuple(self._watches):
                self._unwatch(expression)
            for task in (sending, *self._asks):
                task.cancel()
            await asyncio.gather(sending, *self._asks, return_exceptions=True)

    async def _receive(self, websocket: WebSocket) -> None:
        while True:
            message = FromPage.FromString(await _bytes(websocket))
            if self._cut_off:
                raise WatchError(f"more than {_MOST_UNREAD} bytes wait for a page that does not read")
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
        if len(expression) > _LONGEST_KEY:
            raise WatchError(f"a key of {len(expression)} characters: {_LONGEST_KEY} at most")
        if len(self._watches) >= _MOST_WATCHES:
            raise WatchError(f"more than {_MOST_WATCHES} keys watched by one page")
        if check_expression(expression).history is History.KEY_FRAME:
            self._video[expression] = SteppedVideo(
                expression,
                self._feeds,
                self._views,
                asker=self._asker,
                on_frame=self._wake.set,
                on_starved=self._want_key_frame,
            )
        else:
            self._feeds.join(expression, self._offer)
        self._watches.add(expression)

    def _unwatch(self, expression: str) -> None:
        if expression not in self._watches:
            return
        self._watches.discard(expression)
        # A later watch of the same video must begin with a key frame again.
        video = self._video.pop(expression, None)
        if video is not None:
            video.close()
        else:
            self._feeds.leave(expression, self._offer)
            self._lanes.pop(expression, None)
            self._waiting.pop(expression, None)

    def _offer(self, sample: Sample) -> None:
        lane = self._lanes.get(sample.key)
        if lane is None:
            lane = self._lanes[sample.key] = lane_for(topics.topic(sample.parsed.topic))
        lane.push(sample)
        self._waiting[sample.key] = lane
        self.offered += 1
        self._wake.set()

    async def _send(self, websocket: WebSocket) -> None:
        while True:
            await self._wake.wait()
            self._wake.clear()
            while await self._send_round(websocket):
                pass

    async def _send_round(self, websocket: WebSocket) -> bool:
        """Sends all messages, then one sample of each key, state before video; whether there was any."""
        await self._send_messages(websocket)
        sent = bool(self._waiting)
        waiting, self._waiting = self._waiting, {}
        together: list[bytes] = []
        size = 0
        for key, lane in waiting.items():
            sample = lane.pop()
            if sample is None:
                continue
            if lane.held():
                self._waiting[key] = lane
            together.append(state_bytes(sample))
            size += len(together[-1])
            if size > _MOST_TOGETHER:
                await send_together(websocket, together)
                together, size = [], 0
                await self._send_messages(websocket)
        if together:
            await send_together(websocket, together)
        for video in tuple(self._video.values()):
            await self._send_messages(websocket)
            sample = video.pop()
            if sample is not None:
                await websocket.send_bytes(video_bytes(sample, key=video.key, step=video.step))
                sent = True
        return sent

    async def _send_messages(self, websocket: WebSocket) -> None:
        while self._messages:
            message = self._messages.popleft()
            self._unread -= len(message)
            await websocket.send_bytes(message)
        if self._cut_off:  # it has missed something
            await websocket.close(_POLICY_VIOLATION, "read too slowly")

    def _want_key_frame(self, key: str) -> None:
        now = time.monotonic()
        if now - self._key_frame_asked.get(key, -_KEY_FRAME_EACH_S) < _KEY_FRAME_EACH_S:
            return
        self._key_frame_asked[key] = now

        async def ask() -> None:
            try:
                await self._session.ask(f"{key}/keyframe/{self._asker}", KeyFrameRequest())
            except BusError as error:
                log.debug("no key frame on %s: %s", key, error)

        self._keep(ask())

    def _ask(self, ask: FromPage.Ask) -> None:
        most = _MOST_STOPS if ask.key.endswith("/stop") else _MOST_ASKS
        if len(ask.key) > _LONGEST_KEY:
            text = f"a key of {len(ask.key)} characters: {_LONGEST_KEY} at most"
            self.tell(refusal(ask.id, text))
        elif len(self._asks) >= most:
            self.tell(refusal(ask.id, f"more than {most} requests wait for an answer: try again later"))
        else:
            self._keep(self._answer(ask))

    async def _answer(self, ask: FromPage.Ask) -> None:
        try:
            asked = self._allowed(ask)
            with self.operator.asking(ask.key, asked):
                payload = await self._session.ask_bytes(
                    ask.key, asked, timeout_s=min(ask.timeout_s or 2.0, _LONGEST_ASK_S)
                )
        except (RefusedError, NoAnswerError) as error:
            # To the page a busy owner is a silent one: it asks again while its lease lasts.
            no_answer = isinstance(error, NoAnswerError | BusyError)
            self.tell(refusal(ask.id, str(error), no_answer=no_answer))
        else:
            self._learn_view(ask, payload)
            self.tell(ToPage(answer=ToPage.Answer(id=ask.id, ok=True, payload=payload)))

    def _allowed(self, ask: FromPage.Ask) -> bytes:
        """What is asked, in the page's own name.

        Raises:
            RefusedError: If nobody may ask that from a page, or this account may not.
        """
        row = check_ask(ask.key)
        if self.who is not None:
            check_right(row, ask.key, self.who, self._site)
        elif self.own_name:
            check_own_name(row, ask.key, self.own_name)
        return in_own_name(ask.key, ask.payload, self.own_name) if self.own_name else ask.payload

    def _learn_view(self, ask: FromPage.Ask, payload: bytes) -> None:
        """What a page was given as a view of its own can be reduced like any other."""
        site, robot, name = keys.parse_key(ask.key)
        if topics.request(name).request is ViewRequest:
            request, answer = ViewRequest.FromString(ask.payload), ViewAnswer.FromString(payload)
            self._views.learn(f"{keys.ROOT}/{site}/{robot}", request, answer)

    def _keep(self, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.create_task(work)
        self._asks.add(task)
        task.add_done_callback(self._asks.discard)


async def _bytes(websocket: WebSocket) -> bytes:
    message = await websocket.receive()
    if message["type"] == "websocket.disconnect":
        raise WebSocketDisconnect(message["code"])
    if not isinstance(message.get("bytes"), bytes):
        raise WatchError("a page sends binary messages")
    data: bytes = message["bytes"]
    return data


def refusal(ask_id: int, text: str, *, no_answer: bool = False) -> ToPage:
    """An answer that says why not."""
    return ToPage(answer=ToPage.Answer(id=ask_id, ok=False, error=text, no_answer=no_answer))
