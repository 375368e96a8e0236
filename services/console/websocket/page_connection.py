"""One browser on the page's WebSocket: what it watches goes down, what it asks goes up.

A slow browser slows nobody: its lanes keep the newest, and it is sent what fits its line.
"""

import asyncio
import contextlib
import logging
import time
from collections import deque
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

from google.protobuf.message import DecodeError
from starlette.websockets import WebSocket, WebSocketDisconnect

from robomesh import keys, topics
from robomesh import reason_codes as codes
from robomesh.errors import BusError, BusyError, NoAnswerError, RefusedError
from robomesh.messages import reason_message
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import FromPage, KeyFrameRequest, ToPage, ViewAnswer, ViewRequest
from robomesh.session import Session
from robomesh.topics import History
from services.console.accounts.rights import check_own_name, check_right, in_own_name, parse_request
from services.console.accounts.sessions import SignedIn
from services.console.errors import WatchError
from services.console.requested_views import Views
from services.console.websocket.adaptive_video import SteppedVideo
from services.console.websocket.framing import (
    MOST_BEHIND,
    MOST_TOGETHER,
    Moment,
    frame,
    state_frame,
    video_frame,
)
from services.console.websocket.operator_liveliness import OperatorPresence
from services.console.websocket.send_queues import Lane, lane_for
from services.console.websocket.shared_subscriptions import Feeds, check_expression
from services.console.websocket.websocket_transport import Line, line_of

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
_POLICY_VIOLATION, _LONGEST_REASON = 1008, 120


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
        self.operator = OperatorPresence(session, own_name)
        self.who, self.own_name = who, own_name
        # Who is nobody asks as this connection, as its page does.
        self._asker = own_name or self.operator.id
        self._greet, self._site = greet, site
        self._session = session
        self._feeds = feeds
        self._views = views
        self._watches: set[str] = set()
        # State: what keeps step is sent as it came; once the line takes no more, it waits in lanes, until
        # they are empty.
        self._moments: deque[Moment] = deque()
        self._behind = False
        self._lanes: dict[str, Lane] = {}
        self._video: dict[str, SteppedVideo] = {}
        # The lanes and views that have something to send; each in turn sends one sample.
        self._waiting: dict[str, Lane | SteppedVideo] = {}
        self._key_frame_asked: dict[str, float] = {}
        self._messages: deque[bytes] = deque()
        self._unread = 0
        self._cut_off = False
        self._asks: set[asyncio.Task[None]] = set()
        self._websocket: WebSocket | None = None
        self._line: Line | None = None
        self._soon: asyncio.Handle | None = None
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
            self._serve_soon()

    async def run(self, websocket: WebSocket) -> None:
        """Serves it until it goes."""
        line = line_of(websocket)
        self._websocket, self._line = websocket, line
        line.on_ready = self._serve_soon
        self._serve_soon()
        try:
            await self._receive(websocket)
        except WebSocketDisconnect:
            pass
        except (WatchError, DecodeError) as error:
            log.warning("a browser was cut off: %s", error)
            with contextlib.suppress(TimeoutError):  # who reads nothing is not told either
                async with asyncio.timeout(_CLOSED_WITHIN_S):
                    await websocket.close(_POLICY_VIOLATION, _reason(error))
        finally:
            self.operator.close()
            for expression in tuple(self._watches):
                self._unwatch(expression)
            line.on_ready = self._line = None
            for task in self._asks:
                task.cancel()
            await asyncio.gather(*self._asks, return_exceptions=True)

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
                on_frame=partial(self._frame_came, expression),
                on_starved=self._want_key_frame,
            )
            self._frame_came(expression)
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

    def _offer(self, moment: Moment) -> None:
        self.offered += len(moment.samples) + moment.overtaken
        if self._behind:
            self._wait(moment)
        else:
            self._moments.append(moment)
        self._feeds.turns.due(self._serve)

    def _frame_came(self, expression: str) -> None:
        video = self._video.get(expression)
        if video is not None:  # it is given what is held before it is kept here
            self._waiting[expression] = video
            self._feeds.turns.due(self._serve)

    def _wait(self, moment: Moment) -> None:
        """What the line does not take waits in lanes, where newer replaces older."""
        self._behind = True
        for sample in moment.samples:
            lane = self._lanes.get(sample.key)
            if lane is None:
                lane = self._lanes[sample.key] = lane_for(topics.topic(sample.parsed.topic))
            lane.push(sample)
            self._waiting[sample.key] = lane

    def _serve_soon(self) -> None:
        if self._soon is None:
            self._soon = asyncio.get_running_loop().call_soon(self._serve)

    def _serve(self) -> None:
        """Sends as much as the line takes."""
        self._soon = None
        line = self._line
        if line is None:
            return
        while line.ready and (frames := self._frames()):
            line.write(frames)
        while self._moments:
            self._wait(self._moments.popleft())
        if self._cut_off and not self._messages and self._websocket is not None:  # it has missed something
            self._keep(self._websocket.close(_POLICY_VIOLATION, "read too slowly"))
            self._websocket = None

    def _frames(self) -> bytes:
        """What is given to the line at once; nothing: nothing waits."""
        frames: list[bytes] = []
        size = 0
        most = MOST_BEHIND if self._behind else MOST_TOGETHER
        while size < most and (each := self._next()):
            frames.append(each)
            size += len(each)
        return b"".join(frames)

    def _next(self) -> bytes:
        """The next to send: messages before any sample, state that keeps step before what waits."""
        if self._messages:
            message = self._messages.popleft()
            self._unread -= len(message)
            return frame(message)
        if self._moments:
            moment = self._moments.popleft()
            self.sent += len(moment.samples)
            return moment.frames()
        while self._waiting:
            key = next(iter(self._waiting))
            lane = self._waiting.pop(key)
            sample = lane.pop()
            if sample is None:
                continue
            self._waiting[key] = lane  # behind all others
            if isinstance(lane, SteppedVideo):
                return video_frame(sample, key=key, step=lane.step)
            self.sent += 1
            return state_frame(sample)
        self._behind = False
        return b""

    def _want_key_frame(self, key: str) -> None:
        now = time.monotonic()
        if self._line is None or not self._line.ready:
            return  # it would be made for all who watch, and this one takes nothing
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
            reason = codes.KEY_TOO_LONG(count=len(ask.key), most=_LONGEST_KEY)
            self.tell(refusal(ask.id, reason.text, reason))
        elif len(self._asks) >= most:
            reason = codes.PAGE_TOO_MANY(count=most)
            self.tell(refusal(ask.id, reason.text, reason))
        else:
            self._keep(self._answer(ask))

    async def _answer(self, ask: FromPage.Ask) -> None:
        try:
            key, row = parse_request(ask.key)
            asked = self._allowed(ask, key, row)
            with self.operator.asking(key, asked):
                payload = await self._session.ask_bytes(
                    key, asked, timeout_s=min(ask.timeout_s or 2.0, _LONGEST_ASK_S)
                )
        except (RefusedError, NoAnswerError) as error:
            # To the page a busy owner is a silent one: it asks again while its lease lasts.
            no_answer = isinstance(error, NoAnswerError | BusyError)
            reason = error.reason if isinstance(error, RefusedError) else None
            self.tell(refusal(ask.id, str(error), reason, no_answer=no_answer))
        else:
            if row.request is ViewRequest:
                self._learn_view(ask, key, payload)
            self.tell(ToPage(answer=ToPage.Answer(id=ask.id, ok=True, payload=payload)))

    def _allowed(self, ask: FromPage.Ask, key: keys.Key, row: topics.Request) -> bytes:
        """What is asked, in the page's own name.

        Raises:
            RefusedError: If this account may not.
        """
        if self.who is not None:
            check_right(row, key, self.who, self._site)
        elif self.own_name:
            check_own_name(row, key, self.own_name)
        return in_own_name(row, ask.payload, self.own_name) if self.own_name else ask.payload

    def _learn_view(self, ask: FromPage.Ask, key: keys.Key, payload: bytes) -> None:
        """What a page was given as a view of its own can be reduced like any other."""
        request, answer = ViewRequest.FromString(ask.payload), ViewAnswer.FromString(payload)
        self._views.learn(f"{keys.ROOT}/{key.site}/{key.robot}", request, answer)

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


def _reason(error: Exception) -> str:
    """In words, as many of them as a closing frame holds: it counts bytes."""
    return str(error).encode()[:_LONGEST_REASON].decode(errors="ignore")


def refusal(ask_id: int, text: str, reason: Reason | None = None, *, no_answer: bool = False) -> ToPage:
    """Return the answer that refuses a page's request."""
    answer = ToPage.Answer(id=ask_id, ok=False, error=text, no_answer=no_answer)
    if reason is not None:
        answer.refusal.CopyFrom(reason_message(reason))
    return ToPage(answer=answer)
