"""The page of one view, without any control, and the stream that it reads.

    /view/<site>/<robot>/<view>         the page; pages of listed origins may show it in a frame
    /view/<site>/<robot>/<view>/live    its stream: `ToPage`, each after its length (uint32, big-endian)

The stream has the view's newest picture, the controller's state as far as the page shows it, and the
description's kind of robot. It takes no request, so that nothing can be done through it.
"""

import asyncio
import contextlib
import struct
import time
from collections.abc import AsyncGenerator
from dataclasses import dataclass
from pathlib import Path

from google.protobuf.message import DecodeError, Message
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route

from robomesh import reason_codes as codes
from robomesh.contract import topics
from robomesh.contract.header import pack
from robomesh.errors import KeyNameError
from robomesh.publications.subscription import Sample
from robomesh.schemas.robomesh_pb2 import ControllerState, Description, ToPage
from robomesh.wire.session import Session
from services.console.common.error_responses import as_text, with_error_responses
from services.console.common.errors import RefusedRequest
from services.console.common.requested_views import robot_key
from services.console.http.pictures import NewestSampleReader, Pictures
from services.console.websocket.send_queues import NewestQueue

PATH = "/view/{site}/{robot}/{view}"
# The page reconnects after five seconds without a message.
_GREETS_EACH_S = 1.0
# A controller reports more often than a person reads.
_LEAST_INTERVAL_S = 0.1


@dataclass(frozen=True)
class ViewPage:
    """The routes of views' pages.

    Attributes:
        page: Folder of the built page.
    """

    session: Session
    pictures: Pictures
    page: Path

    def routes(self) -> list[Route]:
        """Return the routes of the page and of its stream."""
        return [
            Route(PATH, self.document, methods=["GET"]),
            Route(f"{PATH}/live", with_error_responses(self.live, as_text), methods=["GET"]),
        ]

    async def document(self, _: Request) -> Response:
        """Return the page, which is the same for all views."""
        return FileResponse(self.page / "view.html", headers={"Cache-Control": "no-store"})

    async def live(self, request: Request) -> Response:
        """Send what the page shows until the reader disconnects."""
        view = await self.pictures.view(request)
        path = request.path_params
        try:
            robot = robot_key(path["site"], path["robot"])
        except KeyNameError as error:
            raise RefusedRequest(404, codes.INVALID(error.reason)) from None
        pieces = self._messages(robot, view.image)
        return await self.pictures.stream(request, pieces, view.image, "application/octet-stream")

    async def _messages(self, robot: str, image: str) -> AsyncGenerator[bytes]:
        ready = asyncio.Event()
        subscriptions = self.pictures.subscriptions
        with contextlib.ExitStack() as stack:
            watches = [
                stack.enter_context(
                    contextlib.closing(NewestSampleReader(subscriptions, key, NewestQueue(), ready))
                )
                for key in (f"{robot}/controller", f"{robot}/description", image)
            ]
            greeted_at = -_GREETS_EACH_S
            while True:
                ready.clear()
                messages = [ToPage(sample=shown) for watch in watches if (shown := _shown(watch.pop()))]
                if time.monotonic() - greeted_at >= _GREETS_EACH_S:
                    greeted_at = time.monotonic()
                    messages.insert(0, ToPage(hello=self._hello()))
                if messages:
                    yield b"".join(map(_framed, messages))
                    await asyncio.sleep(_LEAST_INTERVAL_S)
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(_GREETS_EACH_S):
                        await ready.wait()

    def _hello(self) -> ToPage.Hello:
        hello = ToPage.Hello(connected=self.session.connected)
        for name in ("controller", "video/*"):
            hello.stale.add(topic=name, after_s=topics.topic(name).stale_after_s)
        return hello


def _framed(message: Message) -> bytes:
    data = message.SerializeToString()
    return struct.pack(">I", len(data)) + data


def _shown(sample: Sample | None) -> ToPage.Sample | None:
    """Return what the page shows of a sample; None: nothing."""
    if sample is None:
        return None
    try:
        payload = _shown_payload(sample)
    except DecodeError:
        return None
    shown = ToPage.Sample(key=sample.key, attachment=pack(sample.header), payload=payload, live=sample.live)
    if sample.live:
        shown.age_s = time.monotonic() - sample.received + sample.late_s
    return shown


def _shown_payload(sample: Sample) -> bytes:
    """Return a payload without what the page does not show: names of operators, texts, the robot's model."""
    topic = sample.parsed.topic
    if topic == "description":
        described = Description.FromString(sample.payload)
        kept: Message = Description(simulated=described.simulated)
    elif topic == "controller":
        state = ControllerState.FromString(sample.payload)
        kept = ControllerState(
            timestamp=state.timestamp,
            link=state.link,
            activity=state.activity,
            fault="fault" if state.fault else "",
        )
        if state.HasField("stop"):
            kept.stop.sent = state.stop.sent
            kept.stop.since.CopyFrom(state.stop.since)
        if state.HasField("program"):
            kept.program.CopyFrom(state.program)
    else:
        return sample.payload
    return kept.SerializeToString()
