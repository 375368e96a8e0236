"""Define's HTTP requests: validated here, and executed by a worker or on disk.

A refused description also has `problems`, each with its place.
"""

import asyncio
import logging
import sys
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, TypeVar

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import Mount, Route

from robomesh import bounded_json
from robomesh import reason_codes as codes
from robots.descriptions.description import library_names
from robots.descriptions.save_description import (
    read_robot,
    refused_path,
    revision_of,
    write_description,
    zip_description,
)
from robots.schema.errors import RobotError, RobotExistsError
from services.console.accounts.sessions import SignedIn
from services.console.common.error_responses import Handler, as_json, with_error_responses
from services.console.common.errors import RefusedRequest
from services.console.define import saved_robots, store
from services.console.define.settings import DefineSettings
from services.console.define.start import start, started_names, stop
from services.console.define.worker_pool import Workshop

log = logging.getLogger(__name__)

Json = dict[str, Any]
Key = TypeVar("Key")
Value = TypeVar("Value")
_MOST_REMEMBERED = 256
# Parallel uploads: the store does not count or evict incomplete files.
_MOST_UPLOADS = 16


class Define:
    """Define's server: store, workers and routes."""

    def __init__(self, settings: DefineSettings) -> None:
        self.settings = settings
        self.store = store.open_store(settings.store)
        self.workshop = Workshop(self.store.folder, settings.limits)
        self._shapes: OrderedDict[tuple[str, str], Json] = OrderedDict()
        self._joint_counts: OrderedDict[str, int] = OrderedDict()
        self._writing = asyncio.Lock()
        self._uploads = 0

    async def close(self) -> None:
        """Stop the workers."""
        await self.workshop.close()

    def routes(self) -> Mount:
        """Return the routes below /define."""
        return Mount(
            "/define",
            routes=[
                Route("/robots", _answered(self.robots), methods=["GET"]),
                Route("/robots/{name}", _answered(self.robot), methods=["GET"]),
                Route("/files", _answered(self.take_file), methods=["POST"]),
                Route("/mesh", _answered(self.mesh), methods=["POST"]),
                Route("/glb/{sha}", _answered(self.glb), methods=["GET"]),
                Route("/check", _answered(self.check), methods=["POST"]),
                Route("/collisions", _answered(self.collisions), methods=["POST"]),
                Route("/import", _answered(self.import_robot), methods=["POST"]),
                Route("/unzip", _answered(self.unzip), methods=["POST"]),
                Route("/save", _answered(self.save), methods=["POST"]),
                Route("/zip", _answered(self.zip), methods=["POST"]),
                Route("/start", _answered(self.start), methods=["POST"]),
                Route("/stop", _answered(self.stop), methods=["POST"]),
            ],
        )

    # ------------------------------------------------------------------ robots

    async def robots(self, request: Request) -> Response:
        """Return the robots that can be opened, and the folder of saved robots."""
        site = self.settings.site
        running = frozenset(started_names(site)) | {robot.name for robot in site.robot}
        rows = await asyncio.to_thread(lambda: list(saved_robots.listing(site, running)))
        for row in rows:
            if row["joints"] is None:
                row["joints"] = await self._joint_count(row["name"], _asker(request))
        folder = str(site.define.folder)
        return JSONResponse({"robots": rows, "can_start": self.settings.can_start, "folder": folder})

    async def _joint_count(self, name: str, asker: str) -> int:
        """Return the number of joints of a robot that has them in another file; 0 if it cannot be read."""
        revision = ""
        try:
            revision = await asyncio.to_thread(revision_of, self._folder(name))
            if revision in self._joint_counts:
                return self._joint_counts[revision]
            values, files = await self._opened(name)
            folder = await self._laid_out({"files": files})
            found = await self.workshop.quick.run("joint_count", folder, {"description": values}, asker=asker)
            count: int = found["joints"]
        except (RefusedRequest, RobotError, OSError):
            count = 0  # the page shows the error when the robot is opened
        _remember(self._joint_counts, revision, count)
        return count

    async def robot(self, request: Request) -> Response:
        """Return a robot as a draft; its files are then in the store."""
        name = request.path_params["name"]
        # Taken first, so that a change during reading is noticed when the draft is saved.
        revision = await asyncio.to_thread(revision_of, self._folder(name))
        values, files = await self._opened(name)
        opened = {"description": values, "files": files, "notes": []}
        if "urdf" in values:
            # The page edits D-H rows.
            folder = await self._laid_out({"files": files})
            opened = await self.workshop.slow.run(
                "import", folder, {"description": values}, asker=_asker(request)
            )
        return JSONResponse(opened | {"revision": revision})

    def _folder(self, name: str) -> Path:
        folder = saved_robots.robot_folder(self.settings.site, name)
        if folder is None:
            raise RefusedRequest(404, codes.DEFINE_NO_ROBOT(name=name))
        return folder

    async def _opened(self, name: str) -> tuple[Json, dict[str, str]]:
        """Return a robot's description and files, with the files in the store."""
        folder = self._folder(name)
        values, paths = await asyncio.to_thread(read_robot, folder)
        files = {}
        for path, file in paths.items():
            content = await asyncio.to_thread(file.read_bytes)
            files[path] = await asyncio.to_thread(store.put, self.store, content)
        return values, files

    async def glb(self, request: Request) -> Response:
        """Return a converted mesh."""
        path = store.stored(self.store, request.path_params["sha"])
        if path is None:
            raise RefusedRequest(404, codes.DEFINE_MODEL_GONE())
        return FileResponse(
            path,
            media_type="model/gltf-binary",
            headers={"Cache-Control": "private, max-age=31536000, immutable"},
        )

    # --------------------------------------------------------------------- drafts

    async def take_file(self, request: Request) -> Response:
        """Store a file of a draft."""
        name = request.query_params.get("name", "")
        if reason := refused_path(name):
            raise RefusedRequest(422, reason)
        if self._uploads >= _MOST_UPLOADS:
            raise RefusedRequest(503, codes.DEFINE_UPLOADS(count=_MOST_UPLOADS))
        self._uploads += 1
        try:
            sha, size = await store.put_stream(
                self.store, request.stream(), most_bytes=self.settings.most_file_bytes
            )
        finally:
            self._uploads -= 1
        return JSONResponse({"sha": sha, "size": size})

    async def mesh(self, request: Request) -> Response:
        """Convert a shape file and summarise it; results are cached."""
        asked = await self._json(request, file=str)
        folder = await self._laid_out(asked)
        file = self._file_of(asked)
        known = self._shapes.get((folder.name, file))
        if known is None or store.stored(self.store, known["glb"]) is None:
            known = await self.workshop.slow.run("mesh", folder, {"file": file}, **_job_options(request))
            _remember(self._shapes, (folder.name, file), known)
        return JSONResponse(known)

    async def check(self, request: Request) -> Response:
        """Check a draft while the user types; a newer request cancels an older one."""
        asked = await self._json(request, description=dict)
        folder = await self._laid_out(asked)

        request_ = {"description": asked["description"], "joints": asked.get("joints")}
        return JSONResponse(await self.workshop.quick.run("check", folder, request_, **_job_options(request)))

    async def collisions(self, request: Request) -> Response:
        """Return how each pair of links is checked, or why it is not."""
        asked = await self._json(request, description=dict)
        return await self._slow(request, "collisions", asked, {"description": asked["description"]})

    async def import_robot(self, request: Request) -> Response:
        """Convert a URDF, an OpenHRP VRML file or a robot.toml to a draft."""
        asked = await self._json(request, file=str)
        return await self._slow(
            request, "import", asked, {"file": self._file_of(asked), "files": asked["files"]}
        )

    async def unzip(self, request: Request) -> Response:
        """Store the files of a zip archive."""
        asked = await self._json(request, file=str)
        return await self._slow(request, "unzip", asked, {"file": self._file_of(asked)})

    async def _slow(self, request: Request, job: str, asked: Json, of: Json) -> Response:
        folder = await self._laid_out(asked)
        return JSONResponse(await self.workshop.slow.run(job, folder, of, **_job_options(request)))

    # ------------------------------------------------------------------ save and start

    async def save(self, request: Request) -> Response:
        """Save a draft as a robot of the site, if it has no problems."""
        asked = await self._json(request, description=dict)
        values, folder = asked["description"], await self._laid_out(asked)
        name = values.get("name")
        found = await self.workshop.quick.run("check", folder, {"description": values}, asker=_asker(request))
        problems = found["problems"]
        if name in library_names():
            text = f"name = {name!r}: a robot of the library has that name; give yours another"
            problems.append({"path": ["name"], "text": text})
        if not problems:
            found = await self.workshop.slow.run(
                "meshes", folder, {"description": values}, asker=_asker(request)
            )
            problems = found["problems"]
        if problems:
            raise RefusedRequest(422, codes.DEFINE_PROBLEMS(count=len(problems)), problems=problems)
        files = {path: folder / path for path in asked["files"]}
        own = self.settings.site.define.folder
        replaces, overwrite = str(asked.get("revision") or ""), asked.get("overwrite") is True
        write = partial(write_description, values, files, own, overwrite=overwrite, replaces=replaces)
        try:
            async with self._writing:
                written = await asyncio.to_thread(write)
        except RobotExistsError as error:
            code = codes.DEFINE_CHANGED if error.changed else codes.DEFINE_EXISTS
            reason = code(name=name, folder=own)
            raise RefusedRequest(409, reason, exists=True, changed=error.changed) from None
        log.info("robot saved: %s", written.path)
        return JSONResponse({"name": name, "folder": str(own / name), "revision": written.revision})

    async def zip(self, request: Request) -> Response:
        """Return a draft as a zip archive, finished or not."""
        asked = await self._json(request, description=dict)
        folder = await self._laid_out(asked)
        files = {path: folder / path for path in asked["files"]}
        archive = await asyncio.to_thread(zip_description, asked["description"], files)
        name = asked["description"]["name"]
        return Response(
            archive,
            media_type="application/zip",
            headers={"Content-Disposition": f'attachment; filename="{name}.zip"'},
        )

    async def start(self, request: Request) -> Response:
        """Start a robot as a simulated robot of the site, if all of it can be read."""
        name = (await self._json(request, name=str))["name"]
        values, files = await self._opened(name)
        folder = await self._laid_out({"files": files})
        found = await self.workshop.slow.run("meshes", folder, {"description": values}, asker=_asker(request))
        if found["problems"]:
            raise RefusedRequest(422, codes.DEFINE_UNREADABLE(detail=found["problems"][0]["text"]))
        async with self._writing:
            await asyncio.to_thread(start, self.settings.site, name, can_start=self.settings.can_start)
        return JSONResponse({"site": self.settings.site.site, "robot": name})

    async def stop(self, request: Request) -> Response:
        """Stop a robot that was started from the page."""
        name = (await self._json(request, name=str))["name"]
        async with self._writing:
            await asyncio.to_thread(stop, self.settings.site, name)
        return JSONResponse({"site": self.settings.site.site, "robot": name})

    # --------------------------------------------------------------------------- helpers

    async def _json(self, request: Request, **needed: type) -> Json:
        """Return a request's JSON object.

        Raises:
            RefusedRequest: If it is too large, or lacks a required value.
        """
        body, most = bytearray(), self.settings.most_json_bytes
        async for chunk in request.stream():
            body += chunk
            if len(body) > most:
                raise RefusedRequest(413, codes.TOO_LARGE(bytes=most))
        try:
            asked = bounded_json.loads(body, parse_int=_whole_number)
        except (ValueError, RecursionError) as error:
            raise RefusedRequest(400, codes.NOT_JSON(detail=error)) from None
        if not isinstance(asked, dict):
            raise RefusedRequest(400, codes.NOT_JSON_OBJECT())
        for key, kind in needed.items():
            if not isinstance(asked.get(key), kind):
                code = codes.NEEDS_TEXT if kind is str else codes.NEEDS_OBJECT
                raise RefusedRequest(422, code(field=key))
        return asked

    async def _laid_out(self, asked: Json) -> Path:
        files = asked.setdefault("files", {})
        if not isinstance(files, dict) or not all(isinstance(sha, str) for sha in files.values()):
            raise RefusedRequest(422, codes.DEFINE_FILES())
        return await asyncio.to_thread(store.lay_out, self.store, files)

    @staticmethod
    def _file_of(asked: Json) -> str:
        file: str = asked["file"]
        if file not in asked["files"]:
            raise RefusedRequest(422, codes.DEFINE_FILE_NOT_GIVEN(file=file))
        return file


def _asker(request: Request) -> str:
    """Return the name for taking turns: the account's, otherwise the address."""
    user = request.scope.get("signed_in")
    if isinstance(user, SignedIn):
        return f"account {user.account.name}"
    return request.client.host if request.client else ""


class _JobOptions(TypedDict):
    asker: str
    wanted: Callable[[], Awaitable[bool]]


def _job_options(request: Request) -> _JobOptions:
    return {"asker": _asker(request), "wanted": _client_waits(request)}


def _client_waits(request: Request) -> Callable[[], Awaitable[bool]]:
    """Return a function that tells if the client still waits; abandoned jobs are skipped."""

    async def waits() -> bool:
        return not await request.is_disconnected()

    return waits


def _whole_number(text: str) -> int:
    if len(text) > sys.float_info.max_10_exp:
        raise ValueError(f"a number of {len(text)} digits")
    return int(text)


def _remember(kept: OrderedDict[Key, Value], key: Key, value: Value) -> None:
    kept[key] = value
    while len(kept) > _MOST_REMEMBERED:
        kept.popitem(last=False)


def _answered(handler: Handler) -> Handler:
    return with_error_responses(handler, as_json, _refused)


def _refused(error: Exception) -> RefusedRequest:
    match error:
        case RobotError():
            return RefusedRequest(422, codes.DEFINE_UNREADABLE(detail=error))
        case UnicodeError():
            return RefusedRequest(422, codes.HALF_CHARACTER())
        case RecursionError():
            return RefusedRequest(422, codes.DEFINE_NESTED())
        case OSError():
            log.error("define: %s", error)
            return RefusedRequest(507, codes.DEFINE_DISK(detail=error.strerror))
        case _:
            log.error("define: an internal error", exc_info=error)
            return RefusedRequest(500, codes.FAILED(request="define", detail=repr(error)[:300]))
