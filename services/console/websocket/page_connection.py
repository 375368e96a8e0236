"""One page's WebSocket: sends watched samples, and forwards the page's requests.

A slow page delays no other: its send queues keep the newest samples, and it gets what its line can carry.
"""

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

from google.protobuf.message import DecodeError
from starlette.websockets import WebSocket, WebSocketDisconnect

from robomesh import reason_codes as codes
from robomesh.contract import keys, topics
from robomesh.contract.messages import reason_message
from robomesh.contract.topics import History
from robomesh.errors import BusyError, NoAnswerError, RefusedError, RobomeshError
from robomesh.reasons import Reason
from robomesh.schemas.robomesh_pb2 import (
    FromPage,
    KeyFrameRequest,
    LeaseRequest,
    ToPage,
    ViewAnswer,
    ViewRequest,
)
from robomesh.wire.session import Session
from services.console.accounts.rights import check_own_name, check_right, in_own_name, parse_request
from services.console.accounts.sessions import SignedIn
from services.console.common.errors import WatchError
from services.console.common.requested_views import Views
from services.console.websocket.adaptive_video import AdaptiveVideo
from services.console.websocket.framing import SampleBatch
from services.console.websocket.operator_liveliness import OperatorPresence
from services.console.websocket.send_order import MOST_UNREAD, SendOrder
from services.console.websocket.shared_subscriptions import SharedSubscriptions, check_expression
from services.console.websocket.websocket_transport import WebSocketTransport, transport_of

log = logging.getLogger(__name__)

_MOST_WATCHES = 1024
_MOST_ASKS = 64
_MOST_STOPS = 1024
_LONGEST_KEY = 200
# Costs, compared with a message: a request on the mesh, a new subscription, and held samples for a watch.
_ASK_COST = 3.0
_SUBSCRIPTION_COST, _SAMPLES_OF_COST, _MOST_COST = 10.0, 32.0, 200.0
_CLOSED_WITHIN_S = 1.0
_LONGEST_ASK_S = 30.0  # a collision check of a program
_KEY_FRAME_EACH_S = 1.0
_POLICY_VIOLATION, _LONGEST_REASON = 1008, 120
# Id of the answer that says why the console closes the connection; requests of the page begin at 1.
_NO_REQUEST = 0


class PageConnection:
    """One page's watches and pending requests.

    Args:
        greet: Returns the greeting, which is sent again when it changes.
        site: The console's own site.
        who: The signed-in session; None: the console has no accounts.
        own_name: The operator that the page acts as; empty if it may use any name, without certificates.
        stops_only: Accept nothing but requests for a stop; without a greeting.

    Attributes:
        operator: Presence of the operator who has control through this page.
    """

    def __init__(
        self,
        session: Session,
        subscriptions: SharedSubscriptions,
        views: Views,
        *,
        greet: Callable[["PageConnection"], ToPage],
        site: str,
        user: SignedIn | None = None,
        own_name: str = "",
        stops_only: bool = False,
    ) -> None:
        self.operator = OperatorPresence(session, own_name)
        self.user, self.own_name = user, own_name
        # Anonymous pages use the connection's id.
        self._asker = own_name or self.operator.id
        self._greet, self._site, self.stops_only = greet, site, stops_only
        self._session = session
        self._subscriptions = subscriptions
        self._views = views
        self._watches: set[str] = set()
        self._order = SendOrder()
        self._video: dict[str, AdaptiveVideo] = {}
        self._key_frame_asked: dict[str, float] = {}
        self._asks: set[asyncio.Task[None]] = set()
        self._websocket: WebSocket | None = None
        self._line: WebSocketTransport | None = None
        self._soon: asyncio.Handle | None = None
        # Number of samples for this browser; newer ones replaced those that were not sent.
        self.offered = 0
        if not stops_only:
            self.greet()

    @property
    def in_control(self) -> bool:
        """True if the page got control and has not released it."""
        return self.operator.in_control

    @property
    def sent(self) -> int:
        """Number of samples sent so far."""
        return self._order.sent

    def greet(self) -> None:
        """Send the greeting."""
        self.send_message(self._greet(self))

    def rights_changed(self) -> None:
        """Apply changed rights: control without the right to it ends immediately."""
        if self.user is not None and not self.user.account.may_command:
            self.operator.close(LeaseRequest.NO_RIGHT)
        self.greet()

    def send_message(self, message: ToPage) -> None:
        """Queue a message ahead of samples (greeting, answer, presence); the page must read all of them."""
        self._order.add_message(message.SerializeToString())
        if not self._order.overflowed:
            self._serve_soon()

    async def run(self, websocket: WebSocket) -> None:
        """Serve the browser until it disconnects."""
        line = transport_of(websocket)
        self._websocket, self._line = websocket, line
        line.on_ready = self._serve_soon
        self._serve_soon()
        try:
            await self._receive(websocket)
        except WebSocketDisconnect:
            pass
        except (WatchError, DecodeError) as error:
            reason = error.reason if isinstance(error, WatchError) else codes.PAGE_NOT_A_MESSAGE(detail=error)
            log.warning("a browser was cut off: %s", reason)
            self.send_message(refusal(_NO_REQUEST, reason.text, reason))
            self._serve()
            with contextlib.suppress(TimeoutError):  # a page that reads nothing does not get the reason
                async with asyncio.timeout(_CLOSED_WITHIN_S):
                    await websocket.close(_POLICY_VIOLATION, _close_reason(reason))
        finally:
            signed_out = self.user is not None and self.user.ended
            self.operator.close(LeaseRequest.SIGNED_OUT if signed_out else None)
            for expression in tuple(self._watches):
                self._unwatch(expression)
            line.on_ready = self._line = None
            for task in self._asks:
                task.cancel()
            await asyncio.gather(*self._asks, return_exceptions=True)

    async def _receive(self, websocket: WebSocket) -> None:
        while True:
            message = FromPage.FromString(await _bytes(websocket))
            if self._order.overflowed:
                raise WatchError(codes.PAGE_READS_TOO_SLOWLY(bytes=MOST_UNREAD))
            if self.stops_only and not message.ask.key.endswith("/stop"):
                raise WatchError(codes.PAGE_STOPS_ONLY())
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
            raise WatchError(codes.KEY_TOO_LONG(count=len(expression), most=_LONGEST_KEY))
        if len(self._watches) >= _MOST_WATCHES:
            raise WatchError(codes.PAGE_TOO_MANY_KEYS(count=_MOST_WATCHES))
        if expression not in self._subscriptions:
            self._spend(_SUBSCRIPTION_COST)
        if check_expression(expression).history is History.KEY_FRAME:
            self._video[expression] = AdaptiveVideo(
                expression,
                self._subscriptions,
                self._views,
                asker=self._asker,
                on_frame=partial(self._queue_frame, expression),
                on_starved=self._want_key_frame,
            )
            self._queue_frame(expression)
        else:
            offered = self.offered
            self._subscriptions.join(expression, self._offer)
            self._spend((self.offered - offered) / _SAMPLES_OF_COST)
        self._watches.add(expression)

    def _unwatch(self, expression: str) -> None:
        if expression not in self._watches:
            return
        self._watches.discard(expression)
        # A new watch of the same video must begin with a key frame.
        video = self._video.pop(expression, None)
        if video is not None:
            video.close()
        else:
            self._subscriptions.leave(expression, self._offer)
        self._order.remove(expression)

    def _spend(self, cost: float) -> None:
        if self._line is not None:
            self._line.spend(min(cost, _MOST_COST))

    def _offer(self, batch: SampleBatch) -> None:
        self.offered += len(batch.samples) + batch.overtaken
        self._order.add_batch(batch)
        self._subscriptions.scheduler.schedule(self._serve)

    def _queue_frame(self, expression: str) -> None:
        video = self._video.get(expression)
        if video is not None:  # None while the watch is being set up
            self._order.add_video(expression, video)
            self._subscriptions.scheduler.schedule(self._serve)

    def _serve_soon(self) -> None:
        if self._soon is None:
            self._soon = asyncio.get_running_loop().call_soon(self._serve)

    def _serve(self) -> None:
        """Write as much as the connection accepts."""
        self._soon = None
        line = self._line
        if line is None:
            return
        while line.ready and (data := self._order.next_write()):
            line.write(data)
        self._order.hold()
        if (
            self._order.overflowed and not self._order.has_messages and self._websocket is not None
        ):  # messages were dropped
            self._keep(self._websocket.close(_POLICY_VIOLATION, "read too slowly"))
            self._websocket = None

    def _want_key_frame(self, key: str) -> None:
        now = time.monotonic()
        if self._line is None or not self._line.ready:
            return  # all viewers would get the key frame, but this one accepts no data
        if now - self._key_frame_asked.get(key, -_KEY_FRAME_EACH_S) < _KEY_FRAME_EACH_S:
            return
        self._key_frame_asked[key] = now

        async def ask() -> None:
            try:
                await self._session.ask(f"{key}/keyframe/{self._asker}", KeyFrameRequest())
            except RobomeshError as error:
                log.debug("no key frame on %s: %s", key, error)

        self._keep(ask())

    def _ask(self, ask: FromPage.Ask) -> None:
        most = _MOST_STOPS if ask.key.endswith("/stop") else _MOST_ASKS
        if len(ask.key) > _LONGEST_KEY:
            reason = codes.KEY_TOO_LONG(count=len(ask.key), most=_LONGEST_KEY)
            self.send_message(refusal(ask.id, reason.text, reason))
        elif len(self._asks) >= most:
            reason = codes.PAGE_TOO_MANY(count=most)
            self.send_message(refusal(ask.id, reason.text, reason))
        else:
            self._spend(_ASK_COST)
            self._keep(self._answer(ask))

    async def _answer(self, ask: FromPage.Ask) -> None:
        try:
            key, row = parse_request(ask.key)
            asked = self._allowed(ask, key, row)
            with self.operator.during_request(key, asked) as answered:
                payload = await self._session.ask_bytes(
                    key, asked, timeout_s=min(ask.timeout_s or 2.0, _LONGEST_ASK_S)
                )
                answered(payload)
        except (RefusedError, NoAnswerError) as error:
            # The page treats a busy service like a timeout: it retries while its lease lasts.
            no_answer = isinstance(error, NoAnswerError | BusyError)
            self.send_message(refusal(ask.id, str(error), error.reason, no_answer=no_answer))
        else:
            if row.request is ViewRequest:
                self._learn_view(ask, key, payload)
            self.send_message(ToPage(answer=ToPage.Answer(id=ask.id, ok=True, payload=payload)))

    def _allowed(self, ask: FromPage.Ask, key: keys.Key, row: topics.Request) -> bytes:
        """Return the request's payload with the page's own operator name.

        Raises:
            RefusedError: If this account may not send it.
        """
        if self.user is not None:
            check_right(row, key, self.user, self._site)
        elif row.administrators:
            raise RefusedError(codes.NEEDS_ADMINISTRATOR())
        elif self.own_name:
            check_own_name(row, key, self.own_name)
        return in_own_name(row, ask.payload, self.own_name) if self.own_name else ask.payload

    def _learn_view(self, ask: FromPage.Ask, key: keys.Key, payload: bytes) -> None:
        """Remember a view that the page requested, so that it can be reduced like any other."""
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
        raise WatchError(codes.PAGE_TEXT())
    data: bytes = message["bytes"]
    return data


def _close_reason(reason: Reason) -> str:
    """Return the reason's sentence, cut to the bytes that a close frame can hold."""
    return reason.text.encode()[:_LONGEST_REASON].decode(errors="ignore")


def refusal(ask_id: int, text: str, reason: Reason | None = None, *, no_answer: bool = False) -> ToPage:
    """Return the answer that refuses a page's request."""
    answer = ToPage.Answer(id=ask_id, ok=False, error=text, no_answer=no_answer)
    if reason is not None:
        answer.refusal.CopyFrom(reason_message(reason))
    return ToPage(answer=answer)
