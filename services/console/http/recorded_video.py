"""MP4 of a part of a recording, rendered by the site while a page waits for it.

    POST /recordings/<site>/<file>/video?from=S&to=S&view=V     lines of JSON until the end, then
    GET  /recordings/<site>/<file>/video.mp4?id=ID              the file, for ten minutes

Each line has `state` ("waiting", "fetching", "rendering", "done", "failed") and `progress`; "done" has `id`,
"failed" a `refusal`. The work lives as long as the request: a page that cancels, closes or loses its network
ends it, with its process and its files.
"""

import asyncio
import contextlib
import fcntl
import json
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import quote

from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Route
from starlette.types import Scope

from robomesh import reason_codes as codes
from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.contract.keys import check_chunk
from robomesh.contract.messages import reason_message, to_json
from robomesh.errors import CodedError
from robomesh.files.worker import Worker
from robomesh.reasons import Reason
from robomesh.recordings.names import SUFFIX
from robomesh.wire.session import Session
from services.console.common.error_responses import Handler, as_text, refused_error, with_error_responses
from services.console.common.errors import RefusedRequest
from services.console.http.recording_span import Span, span_of
from services.console.http.streaming import Streamed

# Rendering needs the packages of a renderer, which a console on another machine may lack.
_MODULE = "services.export.render_worker"
_NICE = 10
_LONGEST_S = 900.0
_MOST_WAITING = 4
_MOST_KEPT, _KEPT_S = 4, 600.0
_READS_WITHIN_S = 60.0
_LINE_EACH_S = 0.5
_SIZE, _FPS, _SAMPLES = (1280, 720), 30.0, 4
_FREE_BYTES = 200 << 20
# Not in a memory file system, as /tmp often is: recordings are large.
_PLACE = "/var/tmp"
_FOLDER = "robomesh-video-"
_LOCK = ".lock"


@dataclass
class _Job:
    """One video that is being made."""

    file: RecorderFile
    span: Span
    view: str
    total: int
    folder: Path
    state: str = "waiting"
    progress: float = 0.0
    task: "asyncio.Task[tuple[int, float]] | None" = None
    id: str = field(default_factory=lambda: secrets.token_hex(8))

    @property
    def target(self) -> Path:
        """The file that is rendered."""
        return self.folder / f"{self.id}.mp4"


class RecordedVideo:
    """The routes; one video at a time is made, the others wait.

    Args:
        asker: Returns the name for a request over HTTP.
    """

    def __init__(self, session: Session, asker: Callable[[Scope], str]) -> None:
        self._session, self._asker = session, asker
        self._turn = asyncio.Semaphore(1)
        self._tasks: set[asyncio.Task[tuple[int, float]]] = set()
        self._folder: Path | None = None
        self._lock = -1
        self._kept: dict[str, float] = {}

    def routes(self) -> list[Route]:
        """Return the routes."""
        return [
            Route("/recordings/{site}/{file}/video", _answered(self.render), methods=["POST"]),
            Route("/recordings/{site}/{file}/video.mp4", _answered(self.send), methods=["GET"]),
        ]

    async def render(self, request: Request) -> Response:
        """Render a part of a recording, and report the progress."""
        site, name = request.path_params["site"], request.path_params["file"]
        file = RecorderFile(self._session, site, name, asker=self._asker(request.scope))
        info = await file.describe()
        span = span_of(info, request.query_params)
        if span.length_s(info) > _LONGEST_S:
            raise RefusedRequest(400, codes.RECORDING_VIDEO_LONG(most=_LONGEST_S / 60))
        view = check_chunk(request.query_params.get("view") or "free", "view")
        total = (await file.piece()).total
        folder = await asyncio.to_thread(self._own_folder)
        if shutil.disk_usage(folder).free < total + _FREE_BYTES:
            raise RefusedRequest(507, codes.RECORDING_VIDEO_SPACE(mib=(total + _FREE_BYTES) / (1 << 20)))
        if len(self._tasks) >= _MOST_WAITING:
            raise RefusedRequest(503, codes.RECORDING_VIDEO_BUSY(count=len(self._tasks)), again_s=30.0)
        job = _Job(file, span, view, total, folder)
        job.task = asyncio.create_task(self._make(job))
        self._tasks.add(job.task)
        job.task.add_done_callback(self._tasks.discard)
        headers = {"Cache-Control": "no-store", "Content-Type": "application/octet-stream"}

        async def end() -> None:
            assert job.task is not None
            # Not awaited: the response is being cancelled too, which would cancel the clean-up.
            job.task.cancel()

        return Streamed(self._lines(job), headers, within_s=_READS_WITHIN_S, on_end=end)

    async def send(self, request: Request) -> Response:
        """Send a video that was made."""
        id_, name = request.query_params.get("id", ""), request.path_params["file"]
        self._forget_old()
        if self._folder is None or id_ not in self._kept:
            raise RefusedRequest(404, codes.RECORDING_VIDEO_GONE(minutes=_KEPT_S / 60))
        saved = quote(name.removesuffix(SUFFIX) + ".mp4")
        headers = {
            "Cache-Control": "no-store",
            "Content-Disposition": f"attachment; filename*=UTF-8''{saved}",
        }
        return FileResponse(self._folder / f"{id_}.mp4", media_type="video/mp4", headers=headers)

    async def _lines(self, job: _Job) -> AsyncIterator[bytes]:
        assert job.task is not None
        while True:
            # Each line also shows whether the page is still there.
            yield _line(state=job.state, progress=round(job.progress, 3))
            done, _ = await asyncio.wait([job.task], timeout=_LINE_EACH_S)
            if done:
                break
        try:
            pictures, seconds = job.task.result()
        except Exception as error:
            yield _line(state="failed", refusal=json.loads(to_json(reason_message(_reason_of(error)))))
            return
        self._keep(job)
        yield _line(state="done", progress=1.0, id=job.id, pictures=pictures, seconds=seconds)

    async def _make(self, job: _Job) -> tuple[int, float]:
        source = job.folder / f"{job.id}{SUFFIX}"
        worker = Worker(_MODULE, None, nice=_NICE)

        def fetched(share: float) -> None:
            job.progress = share

        def rendered(share: float) -> None:
            job.progress = share

        made = False
        try:
            async with self._turn:
                job.state = "fetching"
                await job.file.fetch(source, on_progress=fetched)
                job.state, job.progress = "rendering", 0.0
                values = {"view": job.view, "size": _SIZE, "fps": _FPS, "samples": _SAMPLES}
                question = (str(source), str(job.target), job.span.begin_s, job.span.end_s, values)
                answer: tuple[int, float] = await worker.ask(question, timeout_s=None, on_report=rendered)
                made = True
                return answer
        finally:
            await worker.close()
            for path in job.folder.glob(f"*{job.id}*"):
                if not (made and path == job.target):
                    with contextlib.suppress(OSError):
                        path.unlink()

    def _keep(self, job: _Job) -> None:
        self._kept[job.id] = time.monotonic() + _KEPT_S
        asyncio.get_running_loop().call_later(_KEPT_S + 1.0, self._forget_old)
        self._forget_old()

    def _forget_old(self) -> None:
        """Remove videos that are too old or too many."""
        now = time.monotonic()
        many = list(self._kept)[:-_MOST_KEPT]
        for id_ in [id_ for id_, until in self._kept.items() if until <= now or id_ in many]:
            del self._kept[id_]
            if self._folder is not None:
                (self._folder / f"{id_}.mp4").unlink(missing_ok=True)

    def _own_folder(self) -> Path:
        """Return the folder for the videos; remove those that a killed console left."""
        if self._folder is None:
            place = _PLACE if os.access(_PLACE, os.W_OK) else tempfile.gettempdir()
            for left in Path(place).glob(f"{_FOLDER}*"):
                _remove_unused(left)
            folder = Path(tempfile.mkdtemp(prefix=_FOLDER, dir=place))
            # Held until the process ends, however it ends.
            self._lock = os.open(folder / _LOCK, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o600)
            fcntl.flock(self._lock, fcntl.LOCK_EX)
            self._folder = folder
        return self._folder

    async def close(self) -> None:
        """End what is being made, and remove the videos."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        if self._folder is not None:
            os.close(self._lock)
            await asyncio.to_thread(shutil.rmtree, self._folder, ignore_errors=True)
            self._folder = None


def _remove_unused(folder: Path) -> None:
    """Remove the folder of a console that runs no more."""
    with contextlib.suppress(OSError):
        lock = os.open(folder / _LOCK, os.O_WRONLY | os.O_CLOEXEC)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            os.close(lock)


def _reason_of(error: Exception) -> Reason:
    if isinstance(error, CodedError):
        return error.reason
    detail = (error.strerror or str(error)) if isinstance(error, OSError) else error
    return codes.OTHER(detail=detail or type(error).__name__)


def _line(**values: object) -> bytes:
    return json.dumps(values, ensure_ascii=False).encode() + b"\n"


def _answered(handler: Handler) -> Handler:
    return with_error_responses(handler, as_text, refused_error)
