"""Recordings over the mesh and over HTTP: lists, ranges, values, whole files, refusals."""

import asyncio
import csv
import io
import os
import shutil
import signal
import subprocess
import time
import zipfile
from contextlib import asynccontextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from urllib.parse import unquote

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from starlette.applications import Starlette

from robomesh import reason_codes as codes
from robomesh.contract.keys import WHOLE_SITE
from robomesh.contract.quotas import DEFAULT_QUOTAS, Quotas
from robomesh.errors import BrokenAnswerError, BusyError, QuotaError, RefusedError
from robomesh.recordings.changes import write_changes
from robomesh.recordings.errors import RecordingError
from robomesh.recordings.files import describe_file
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.console.http.recordings import Recordings
from services.recorder.reading.answers import Answers
from services.recorder.reading.serving import RecordingServer
from tests.conftest import run
from tests.recordings import START_NS, Written, joints, merge, write_capture, write_recording
from tests.refusals import refused
from tests.services.http_refusals import read_refusal

BASE = "robomesh/site/-/recordings"
JOINTS = "robomesh/site/arm/joints"
_BROKEN = codes.BROKEN_ANSWER(codes.PIECE_DROPPED(), key="k", bytes=30_000, total=90_000)


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm").mkdir()
    write_recording(tmp_path / "arm" / "trial.mcap")
    return tmp_path


@asynccontextmanager
async def served(mesh, folder, quotas=DEFAULT_QUOTAS, **open_now):
    """Run a recorder's request handlers; yield a client session."""
    async with open_session(mesh) as service, open_session(mesh) as client:
        service.declare_presence("site", WHOLE_SITE, "recorder")
        server = RecordingServer(
            service, "site", folder, open_now=lambda: open_now, flight=lambda: True, quotas=quotas
        )
        try:
            yield client
        finally:
            await server.close()


async def test_a_recorder_with_a_hanging_reader_is_busy_and_answers_later(mesh, folder):
    async with open_session(mesh) as service, open_session(mesh) as client:
        server = RecordingServer(service, "site", folder, open_now=dict, flight=lambda: True)
        try:
            assert (await client.ask(f"{BASE}/list", timeout_s=50.0)).recordings
            os.kill(server.pid, signal.SIGSTOP)
            for _ in range(2):
                with refused(codes.RECORDER_BUSY, request="list"):
                    await client.ask(f"{BASE}/list", timeout_s=2.0)
            os.kill(server.pid, signal.SIGCONT)
            assert (await client.ask(f"{BASE}/list", timeout_s=50.0)).recordings
        finally:
            await server.close()


def test_list_info_and_range_over_the_mesh_with_their_refusals(mesh, folder):
    (folder / "broken.mcap").write_text("no recording")

    async def main():
        writing = schema.Recording(file="zz.mcap", open=True)
        quotas = Quotas(recordings_mib_a_minute=1e-4)
        async with served(mesh, folder, quotas, **{"zz.mcap": writing}) as session:
            listed = await session.ask(f"{BASE}/list", timeout_s=20.0)
            info = await session.ask(f"{BASE}/info", schema.RecordingQuery(file="trial.mcap"))
            request = schema.RangeRequest(file="trial.mcap", topic=JOINTS, most=10)
            request.start.FromNanoseconds(START_NS + 1_000_000_000)
            messages = await session.ask(f"{BASE}/range/li", request)
            with refused(codes.OVER_QUOTA, quota="recordings_mib_a_minute", most="0.0001"):
                await session.ask(f"{BASE}/range/li", request)
            with refused(codes.RECORDING_UNKNOWN, name="gone.mcap"):
                await session.ask(f"{BASE}/info", schema.RecordingQuery(file="gone.mcap"))
            request.start.FromNanoseconds(START_NS + 60_000_000_000)
            with pytest.raises(RefusedError) as outside:
                await session.ask(f"{BASE}/range/wang", request)
            reason = outside.value.reason
            assert (reason.code, reason.values["file"]) == ("recording.outside", "trial.mcap")
            return listed, info, messages

    listed, info, messages = run(main())
    assert [(row.file, row.open) for row in listed.recordings] == [
        ("zz.mcap", True),
        ("trial.mcap", False),
        ("broken.mcap", False),
    ]
    assert "not an MCAP file" in listed.recordings[2].problem
    assert (listed.flight, listed.free_bytes > 0) == (True, True)
    assert {topic.topic: topic.messages for topic in info.topics}[JOINTS] == 400
    assert (messages.more, messages.schema, len(messages.messages)) == (True, "foxglove.JointStates", 10)
    assert JointStates.FromString(messages.messages[0].data).joints[0].position == 1.0


def test_a_range_of_video_can_begin_with_the_key_frame_before(folder):
    request = schema.RangeRequest(
        file="trial.mcap", topic="robomesh/site/arm/video/front", from_key_frame=True
    )
    request.start.FromNanoseconds(START_NS + 1_300_000_000)
    answer = Answers(folder).range(request)
    assert answer.messages[0].received.ToNanoseconds() == START_NS + 1_000_000_000


def test_series_lists_the_known_values_and_returns_their_numbers(folder):
    answers = Answers(folder)
    known = answers.series(schema.SeriesRequest(file="trial.mcap")).known
    assert "joints/waist/position" in known
    (waist,) = answers.series(
        schema.SeriesRequest(file="trial.mcap", values=["joints/waist/position"], points=100)
    ).series
    assert (min(waist.lowest), max(waist.highest), waist.unit) == (0.0, 3.99, "rad")


def test_a_files_version_is_kept_by_growth_and_changed_by_a_rewrite(tmp_path):
    path = tmp_path / "trial.mcap"
    answers = Answers(tmp_path)
    write_recording(path, chunked=False)
    whole = path.read_bytes()
    path.write_bytes(whole[:40_000])
    before = answers.piece(schema.PieceRequest(file="trial.mcap", offset=100, length=50))
    assert before.data == whole[100:150]
    with path.open("ab") as stream:
        stream.write(whole[40_000:60_000])
    grown = answers.piece(schema.PieceRequest(file="trial.mcap", offset=50_000, length=10))
    assert (grown.version, grown.total, grown.data) == (before.version, 60_000, whole[50_000:50_010])
    rewritten = write_recording(tmp_path / "again", chunked=True)
    rewritten.replace(path)
    assert answers.piece(schema.PieceRequest(file="trial.mcap")).version != before.version


class _Direct:
    """A session that answers from this process, to test only the HTTP routes."""

    def __init__(self, folder):
        self._answers = Answers(folder)

    async def ask(self, key, request, *, timeout_s):
        from robomesh.recordings.errors import RecordingError

        try:
            name = key.split("/recordings/")[1].removesuffix("/li")
            return getattr(self._answers, name)(request)
        except RecordingError as error:
            raise RefusedError(error.reason) from None


@dataclass
class _Answer:
    """An HTTP response."""

    status_code: int
    headers: dict
    content: bytes

    @property
    def text(self):
        return self.content.decode()


class _Http:
    """A client that calls the routes without a socket."""

    def __init__(self, app):
        self._app = app

    def get(self, path, headers=None, method="GET"):
        return run(self.request(path, headers, method))

    async def request(self, path, headers=None, method="GET"):
        raw, _, query = path.partition("?")
        scope = {
            "type": "http",
            "method": method,
            "path": unquote(raw),
            "raw_path": raw.encode(),
            "query_string": query.encode(),
            "headers": [(key.lower().encode(), value.encode()) for key, value in (headers or {}).items()],
        }
        start, body = {}, bytearray()

        async def receive():
            await asyncio.get_running_loop().create_future()  # the client never disconnects

        async def send(message):
            if message["type"] == "http.response.start":
                start.update(message)
            else:
                body.extend(message.get("body", b""))

        await self._app(scope, receive, send)
        named = {key.decode(): value.decode() for key, value in start["headers"]}
        return _Answer(start["status"], named, bytes(body))

    def head(self, path):
        return self.get(path, method="HEAD")


@pytest.fixture
def http(folder):
    return _Http(Starlette(routes=Recordings(_Direct(folder), lambda _: "li").routes()))


def test_a_file_can_be_fetched_whole_in_ranges_and_resumed(http, folder):
    whole = (folder / "arm" / "trial.mcap").read_bytes()
    url = "/recordings/site/trial.mcap"
    answer = http.get(url)
    assert (answer.status_code, answer.content) == (200, whole)
    assert "filename*=UTF-8''trial.mcap" in answer.headers["content-disposition"]
    tag = answer.headers["etag"]
    head = http.head(url)
    assert (head.status_code, head.headers["content-length"], head.content) == (200, str(len(whole)), b"")
    for requested, begin, end in (
        ("bytes=100-199", 100, 200),
        ("bytes=1000-", 1000, len(whole)),
        ("bytes=-10", len(whole) - 10, len(whole)),
        ("bytes=0-99999999", 0, len(whole)),
    ):
        part = http.get(url, headers={"Range": requested, "If-Range": tag})
        assert (part.status_code, part.content) == (206, whole[begin:end])
        assert part.headers["content-range"] == f"bytes {begin}-{end - 1}/{len(whole)}"
    assert http.get(url, headers={"Range": "bytes=5-9", "If-Range": '"older"'}).content == whole
    for invalid in ("lines=5-9", "bytes=0-" + "9" * 5000):
        assert http.get(url, headers={"Range": invalid}).status_code == 200
    assert http.get(url, headers={"If-None-Match": tag}).status_code == 304
    beyond = http.get(url, headers={"Range": "bytes=99999999-"})
    assert (beyond.status_code, beyond.headers["content-range"]) == (416, f"bytes */{len(whole)}")
    reason = read_refusal(beyond.headers, beyond.content)
    assert (reason.code, reason.values["bytes"]) == ("recording.range", str(len(whole)))


@pytest.mark.slow
def test_several_recordings_are_one_zip_that_other_programs_read(http, folder, tmp_path):
    paths = [folder / "arm" / "trial.mcap", write_recording(folder / "arm" / "other.mcap")]
    change = schema.RecordingChange(number=1, change=1, name="renamed", author="li")
    write_changes(paths[1], [change])
    answer = http.get("/recordings.zip?" + "&".join(f"recording=site/{path.name}" for path in paths))
    assert answer.status_code == 200
    saved = tmp_path / "saved.zip"
    saved.write_bytes(answer.content)
    with zipfile.ZipFile(saved) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == ["trial.mcap", "other.mcap", "other.changes.json"]
        for path in paths:
            assert archive.read(path.name) == path.read_bytes()
            assert archive.getinfo(path.name).compress_type == zipfile.ZIP_STORED
        archive.extractall(tmp_path / "out")
    assert describe_file(tmp_path / "out" / "other.mcap").name == "renamed"
    if unzip := shutil.which("unzip"):
        subprocess.run([unzip, "-tq", str(saved)], check=True)


@pytest.mark.parametrize(
    ("query", "status", "code"),
    [
        ("", 400, "recording.zip"),
        ("&".join(f"recording=site/{each}.mcap" for each in range(101)), 400, "recording.zip"),
        ("recording=site/trial.mcap&recording=site/gone.mcap", 404, "recording.unknown"),
        ("recording=**/trial.mcap", 400, None),
        ("recording=trial.mcap", 400, None),
        ("recording=site/../../trial.mcap", 400, None),
        ("recording=site/.profile", 400, None),
    ],
)
def test_a_zip_of_no_recordings_is_refused(query, status, code, http):
    answer = http.get(f"/recordings.zip?{query}")
    assert answer.status_code == status
    assert code in (None, read_refusal(answer.headers, answer.content).code)


def test_a_part_of_the_table_is_the_rows_of_that_time(http, folder):
    url = "/recordings/site/trial.mcap/values.csv"
    rows = list(csv.reader(io.StringIO(http.get(url).text)))
    times = [float(row[3]) for row in rows[1:]]
    # The range counts receive times, a little after the published ones.
    begin, end = times[len(times) // 4] - 2e-4, times[len(times) // 2] + 2e-4
    answer = http.get(f"{url}?from={begin}&to={end}")
    assert answer.status_code == 200
    part = list(csv.reader(io.StringIO(answer.text)))
    assert part == [rows[0], *(row for row in rows[1:] if begin <= float(row[3]) <= end)]
    for invalid in ("from=x", "from=-1", "from=2&to=1", "from=1e9", "from=nan", "to=-1"):
        refused_part = http.get(f"{url}?{invalid}")
        assert refused_part.status_code == 400
        assert read_refusal(refused_part.headers, refused_part.content).code == "recording.span"


def test_values_of_several_robots_are_not_one_table(http, folder):
    merge(
        [
            write_recording(folder / "arm" / "one.mcap"),
            write_capture(folder / "arm" / "other.mcap", range(10), robot="other"),
        ],
        folder / "arm" / "merged.mcap",
    )
    answer = http.get("/recordings/site/merged.mcap/values.csv")
    assert answer.status_code == 409
    assert read_refusal(answer.headers, answer.content).code == "recording.several_robots"


def test_a_missing_file_or_attachment_is_404_with_a_sentence(http):
    gone = http.get("/recordings/site/gone.mcap")
    assert (gone.status_code, "no recording 'gone.mcap' here" in gone.text) == (404, True)
    assert read_refusal(gone.headers, gone.content).code == "recording.unknown"
    head = http.head("/recordings/site/gone.mcap")
    assert (head.status_code, head.headers["content-type"]) == (404, gone.headers["content-type"])
    none = http.get("/recordings/site/trial.mcap/thumbnail.jpg")
    assert (none.status_code, "no attachment 'thumbnail.jpg'" in none.text) == (404, True)
    reason = read_refusal(none.headers, none.content)
    assert (reason.code, reason.values["file"]) == ("recording.no_attachment", "trial.mcap")
    assert http.get("/recordings/site/..%2Ftrial.mcap").status_code == 404


@pytest.mark.parametrize(
    ("error", "status", "again"),
    [
        (QuotaError("li has had its minute's worth", again_s=30.2), 429, "31"),
        (BusyError("too many requests wait"), 503, "1"),
        (BrokenAnswerError(_BROKEN), 504, None),
    ],
)
def test_http_errors_have_a_status_and_a_retry_after(folder, error, status, again):
    async def refuse(*_, **__):
        raise error

    app = Starlette(routes=Recordings(SimpleNamespace(ask=refuse), lambda _: "li").routes())
    answer = _Http(app).get("/recordings/site/trial.mcap")
    assert (answer.status_code, answer.headers.get("retry-after"), answer.text) == (status, again, str(error))
    code = "request.broken_answer" if status == 504 else "other"
    assert read_refusal(answer.headers, answer.content).code == code


async def test_a_site_without_a_recorder_is_refused_after_one_attempt(mesh):
    began = time.monotonic()
    async with open_session(mesh) as session:
        recordings = Recordings(session, lambda _: "li")
        get = _Http(Starlette(routes=recordings.routes())).request
        answer = await get("/recordings/unknown-site/trial.mcap")
    # The attempts for a site with a slow line take 37 s in all.
    assert time.monotonic() - began < 20.0
    reason = read_refusal(answer.headers, answer.content)
    assert (answer.status_code, reason.code) == (404, "request.no_service")
    assert reason.values == {"services": "recorder", "place": "unknown-site"}


def test_values_as_csv_equal_the_files_numbers(http, folder, monkeypatch):
    with Written(folder / "tool.mcap") as file:
        state = schema.KinematicState(tool_to_base=[1, 0, 0, 0.5, 0, 1, 0, 0.25, 0, 0, 1, 0.125, 0, 0, 0, 1])
        for number in range(100):
            if number == 10:
                file.put("kinematics", state, number / 100)
            file.put("joints", joints(waist=number / 7), number / 100)
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._MESSAGES", 7)  # many answers
    answer = http.get("/recordings/site/tool.mcap/values.csv")
    header, *rows = csv.reader(io.StringIO(answer.text))
    assert header[:5] == ["time", "received", "sequence", "t [s]", "waist [rad]"]
    assert [float(row[4]) for row in rows] == [number / 7 for number in range(100)]
    tool_x = header.index("tool x [m]")
    assert [row[tool_x] for row in rows] == [""] * 10 + ["0.5"] * 26 + [""] * 64
    published, received = "2023-11-14T22:13:20.009999000Z", "2023-11-14T22:13:20.010000000Z"
    assert rows[1][:4] == [published, received, "10", "0.009999000"]


def test_csv_keeps_states_of_equal_times_and_skips_invalid_messages(http, folder, monkeypatch):
    invalid = SimpleNamespace(SerializeToString=lambda: b"\xff")
    with Written(folder / "still.mcap") as file:
        for number in range(50):
            file.put("joints", joints(waist=number), 0.5)
            file.put("joints", joints(waist=number), 0.5)
            file.put("joints", invalid, 0.5)
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._MESSAGES", 7)
    answer = http.get("/recordings/site/still.mcap/values.csv")
    _, *rows = csv.reader(io.StringIO(answer.text))
    # One row for each state: states with equal times and values are not merged.
    assert [float(row[4]) for row in rows] == [number for number in range(50) for _ in range(2)]


def test_a_thumbnail_is_not_sent_again_to_a_client_that_has_it(http, folder):
    with Written(folder / "seen.mcap") as file:
        file.put("joints", joints(waist=1), 0.0)
        file.attach("thumbnail.jpg", b"\xff\xd8picture", "image/jpeg")
    answer = http.get("/recordings/site/seen.mcap/thumbnail.jpg")
    assert (answer.headers["content-type"], answer.content) == ("image/jpeg", b"\xff\xd8picture")
    again = http.get(
        "/recordings/site/seen.mcap/thumbnail.jpg", headers={"If-None-Match": answer.headers["etag"]}
    )
    assert again.status_code == 304


def test_an_empty_file_is_listed_by_its_file_name_with_a_problem(tmp_path):
    (tmp_path / "arm").mkdir()
    empty = tmp_path / "arm" / "2026-11-21T20-55-01.500000Z_full.mcap"
    empty.touch()
    (row,) = Answers(tmp_path).list(schema.RecordingListQuery()).recordings
    assert (row.robot, row.name, row.start.ToJsonString()) == ("arm", "full", "2026-11-21T20:55:01.500Z")
    assert "is empty" in row.problem


@pytest.mark.parametrize("seconds", [1 << 62, -(1 << 62), 253402300800])
def test_a_time_out_of_range_is_refused(folder, seconds):
    for field in ("start", "end"):
        request = schema.RangeRequest(file="trial.mcap", topic=JOINTS)
        getattr(request, field).seconds = seconds
        with pytest.raises(RecordingError, match=r"trial\.mcap: invalid time"):
            Answers(folder).range(request)
