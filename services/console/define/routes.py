"""Define's requests over HTTP: what is asked is checked here, and done by the worker or on disk.

Errors are sentences (text/plain), or the problems of a description with their places.
"""

import asyncio
import json
import logging
import sys
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import Any, TypedDict, TypeVar

from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route

from robots.description import library_names
from robots.errors import RobotError, RobotExistsError
from robots.save_description import read_robot, refused_path, revision_of, write_description, zip_description
from services.console.accounts.sessions import SignedIn
from services.console.define import saved_robots, store
from services.console.define.errors import RefusedRequest
from services.console.define.settings import DefineSettings
from services.console.define.start import start, started_names, stop
from services.console.define.worker_pool import Workshop
from services.console.http.error_responses import Handler, answered

log = logging.getLogger(__name__)

Json = dict[str, Any]
Key = TypeVar("Key")
Value = TypeVar("Value")
_MOST_REMEMBERED = 256
# What has not come whole is in no store, which would make room for it.
_MOST_UPLOADS = 16


class Define:
    """Define's server: its store, its workers, its routes."""

    def __init__(self, settings: DefineSettings) -> None:
        self.settings = settings
        self.store = store.open_store(settings.store)
        self.workshop = Workshop(self.store.folder, settings.limits)
        self._meshes: OrderedDict[tuple[str, str], Json] = OrderedDict()
        self._joint_counts: OrderedDict[str, int] = OrderedDict()
        self._writing = asyncio.Lock()
        self._uploads = 0

    async def close(self) -> None:
        """End the workers."""
        await self.workshop.close()

    def routes(self) -> Mount:
        """Everything below /define."""
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

    # ------------------------------------------------------------------ what there is

    async def robots(self, request: Request) -> Response:
        """What can be opened, and where robots are saved."""
        site = self.settings.site
        running = frozenset(started_names(site)) | {robot.name for robot in site.robot}
        rows = await asyncio.to_thread(lambda: list(saved_robots.listing(site, running)))
        for row in rows:
            if row["joints"] is None:
                row["joints"] = await self._joint_count(row["name"], _asker(request))
        folder = str(site.define.folder)
        return JSONResponse({"robots": rows, "can_start": self.settings.can_start, "folder": folder})

    async def _joint_count(self, name: str, asker: str) -> int:
        """Of a robot whose joints are in another file than its robot.toml; 0 where it cannot be read."""
        revision = ""
        try:
            revision = await asyncio.to_thread(revision_of, self._folder(name))
            if revision in self._joint_counts:
                return self._joint_counts[revision]
            values, files = await self._opened(name)
            folder = await self._laid_out({"files": files})
            found = await self.workshop.quick.do("joint_count", folder, {"description": values}, asker=asker)
            count: int = found["joints"]
        except (RefusedRequest, RobotError, OSError):
            count = 0  # what is wrong with it is told when it is opened
        _remember(self._joint_counts, revision, count)
        return count

    async def robot(self, request: Request) -> Response:
        """A robot in a draft's form; its files are in the store then."""
        name = request.path_params["name"]
        # Before it is read: what changes meanwhile is asked about when it is saved.
        revision = await asyncio.to_thread(revision_of, self._folder(name))
        values, files = await self._opened(name)
        opened = {"description": values, "files": files, "notes": []}
        if "urdf" in values:
            # What is edited is D-H rows.
            folder = await self._laid_out({"files": files})
            opened = await self.workshop.slow.do(
                "import", folder, {"description": values}, asker=_asker(request)
            )
        return JSONResponse(opened | {"revision": revision})

    def _folder(self, name: str) -> Path:
        folder = saved_robots.robot_folder(self.settings.site, name)
        if folder is None:
            raise RefusedRequest(404, f"there is no robot {name!r} here")
        return folder

    async def _opened(self, name: str) -> tuple[Json, dict[str, str]]:
        """A robot's values and files, the files in the store."""
        folder = self._folder(name)
        values, paths = await asyncio.to_thread(read_robot, folder)
        files = {}
        for path, file in paths.items():
            content = await asyncio.to_thread(file.read_bytes)
            files[path] = await asyncio.to_thread(store.put, self.store, content)
        return values, files

    async def glb(self, request: Request) -> Response:
        """A converted mesh."""
        path = store.stored(self.store, request.path_params["sha"])
        if path is None:
            raise RefusedRequest(404, "this mesh is not here any more; load the page again")
        return FileResponse(
            path,
            media_type="model/gltf-binary",
            headers={"Cache-Control": "private, max-age=31536000, immutable"},
        )

    # --------------------------------------------------------------------- a draft's

    async def take_file(self, request: Request) -> Response:
        """Keep a file of a draft."""
        name = request.query_params.get("name", "")
        if reason := refused_path(name):
            raise RefusedRequest(422, f"name {name!r}: {reason}")
        if self._uploads >= _MOST_UPLOADS:
            raise RefusedRequest(503, f"{_MOST_UPLOADS} files are being sent already: try again in a moment")
        self._uploads += 1
        try:
            sha, size = await store.put_stream(
                self.store, request.stream(), most_bytes=self.settings.most_file_bytes
            )
        finally:
            self._uploads -= 1
        return JSONResponse({"sha": sha, "size": size})

    async def mesh(self, request: Request) -> Response:
        """A mesh file converted, and what is in it; converted once."""
        asked = await self._json(request, file=str)
        folder = await self._laid_out(asked)
        file = self._file_of(asked)
        known = self._meshes.get((folder.name, file))
        if known is None or store.stored(self.store, known["glb"]) is None:
            known = await self.workshop.slow.do("mesh", folder, {"file": file}, **_of(request))
            _remember(self._meshes, (folder.name, file), known)
        return JSONResponse(known)

    async def check(self, request: Request) -> Response:
        """Asked as one types: who has asked anew meanwhile has gone, and costs nothing."""
        asked = await self._json(request, description=dict)
        folder = await self._laid_out(asked)

        request_ = {"description": asked["description"], "joints": asked.get("joints")}
        return JSONResponse(await self.workshop.quick.do("check", folder, request_, **_of(request)))

    async def collisions(self, request: Request) -> Response:
        """How each pair of links is checked, or why it is not."""
        asked = await self._json(request, description=dict)
        return await self._slow(request, "collisions", asked, {"description": asked["description"]})

    async def import_robot(self, request: Request) -> Response:
        """A URDF, an OpenHRP VRML file or a robot.toml as a draft."""
        asked = await self._json(request, file=str)
        return await self._slow(
            request, "import", asked, {"file": self._file_of(asked), "files": asked["files"]}
        )

    async def unzip(self, request: Request) -> Response:
        """The files of a zip archive, kept each for itself."""
        asked = await self._json(request, file=str)
        return await self._slow(request, "unzip", asked, {"file": self._file_of(asked)})

    async def _slow(self, request: Request, job: str, asked: Json, of: Json) -> Response:
        folder = await self._laid_out(asked)
        return JSONResponse(await self.workshop.slow.do(job, folder, of, **_of(request)))

    # ------------------------------------------------------------------ save and start

    async def save(self, request: Request) -> Response:
        """Save a draft as a robot of the site, once nothing is wrong with it."""
        asked = await self._json(request, description=dict)
        values, folder = asked["description"], await self._laid_out(asked)
        name = values.get("name")
        found = await self.workshop.quick.do("check", folder, {"description": values}, asker=_asker(request))
        problems = found["problems"]
        if name in library_names():
            text = f"name = {name!r}: a robot of the library has that name; give yours another"
            problems.append({"path": ["name"], "text": text})
        if not problems:
            found = await self.workshop.slow.do(
                "meshes", folder, {"description": values}, asker=_asker(request)
            )
            problems = found["problems"]
        if problems:
            return JSONResponse({"problems": problems}, status_code=422)
        files = {path: folder / path for path in asked["files"]}
        own = self.settings.site.define.folder
        replaces, overwrite = str(asked.get("revision") or ""), asked.get("overwrite") is True
        write = partial(write_description, values, files, own, overwrite=overwrite, replaces=replaces)
        try:
            async with self._writing:
                written = await asyncio.to_thread(write)
        except RobotExistsError as error:
            there = f"there is a robot {name} in {own} already"
            text = f"{name} in {own} was changed since it was opened" if error.changed else there
            return JSONResponse({"exists": True, "text": text, "changed": error.changed}, status_code=409)
        log.info("robot saved: %s", written.path)
        return JSONResponse({"name": name, "folder": str(own / name), "revision": written.revision})

    async def zip(self, request: Request) -> Response:
        """A draft as a zip archive, finished or not."""
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
        """Start a robot as a simulated one of the site, once all of it could be read."""
        name = (await self._json(request, name=str))["name"]
        values, files = await self._opened(name)
        folder = await self._laid_out({"files": files})
        found = await self.workshop.slow.do("meshes", folder, {"description": values}, asker=_asker(request))
        if found["problems"]:
            raise RefusedRequest(422, found["problems"][0]["text"])
        async with self._writing:
            await asyncio.to_thread(start, self.settings.site, name, can_start=self.settings.can_start)
        return JSONResponse({"site": self.settings.site.site, "robot": name})

    async def stop(self, request: Request) -> Response:
        """End a robot that was started from the page."""
        name = (await self._json(request, name=str))["name"]
        async with self._writing:
            await asyncio.to_thread(stop, self.settings.site, name)
        return JSONResponse({"site": self.settings.site.site, "robot": name})

    # --------------------------------------------------------------------------- parts

    async def _json(self, request: Request, **needed: type) -> Json:
        """A request's JSON object.

        Raises:
            RefusedRequest: If it is too large, or is not one that holds what is needed.
        """
        body, most = bytearray(), self.settings.most_json_bytes
        async for chunk in request.stream():
            body += chunk
            if len(body) > most:
                raise RefusedRequest(413, f"the request is larger than {most / 1e6:g} MB")
        try:
            asked = json.loads(body, parse_int=_whole_number)
        except (ValueError, RecursionError) as error:
            raise RefusedRequest(400, f"the request is not JSON: {error}") from None
        if not isinstance(asked, dict):
            raise RefusedRequest(400, "the request must be a JSON object")
        for key, kind in needed.items():
            if not isinstance(asked.get(key), kind):
                word = "a text" if kind is str else "an object"
                raise RefusedRequest(422, f"{key} = {str(asked.get(key))[:60]!r}: must be {word}")
        return asked

    async def _laid_out(self, asked: Json) -> Path:
        files = asked.setdefault("files", {})
        if not isinstance(files, dict) or not all(isinstance(sha, str) for sha in files.values()):
            raise RefusedRequest(422, "files: must give each path the SHA-256 of its file")
        return await asyncio.to_thread(store.lay_out, self.store, files)

    @staticmethod
    def _file_of(asked: Json) -> str:
        file: str = asked["file"]
        if file not in asked["files"]:
            raise RefusedRequest(422, f"file {file!r}: is not one of the files given")
        return file


def _asker(request: Request) -> str:
    """Whose turn a job takes: the account's, else the address's."""
    who = request.scope.get("signed_in")
    if isinstance(who, SignedIn):
        return f"account {who.account.name}"
    return request.client.host if request.client else ""


class _Of(TypedDict):
    asker: str
    wanted: Callable[[], Awaitable[bool]]


def _of(request: Request) -> _Of:
    return {"asker": _asker(request), "wanted": _waits(request)}


def _waits(request: Request) -> Callable[[], Awaitable[bool]]:
    """Whether whoever asked is still there: a job that nobody waits for takes no other's time."""

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
    return answered(handler, _refused)


def _refused(error: Exception) -> Response:
    match error:
        case RefusedRequest():
            return PlainTextResponse(error.text, status_code=error.status)
        case RobotError():
            return PlainTextResponse(str(error), status_code=422)
        case UnicodeError():
            return PlainTextResponse("the request holds half a character", status_code=422)
        case RecursionError():
            return PlainTextResponse("the request is nested too deeply", status_code=422)
        case OSError():
            log.error("define: %s", error)
            return PlainTextResponse(f"the console's disk: {error.strerror}", status_code=507)
        case _:
            log.error("define: a fault of robomesh itself", exc_info=error)
            return PlainTextResponse(f"a fault of robomesh itself: {error!r}"[:300], status_code=500)
