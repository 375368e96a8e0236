"""Recordings over the mesh and over HTTP: lists, ranges, values, whole files, and what is refused."""

import asyncio
import csv
import io
import os
import signal
from contextlib import asynccontextmanager
from dataclasses import dataclass
from types import SimpleNamespace
from urllib.parse import unquote

import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from starlette.applications import Starlette

from mcap_files.errors import RecordingError
from robomesh.errors import BrokenAnswerError, BusyError, QuotaError, RefusedError
from robomesh.quotas import DEFAULT_QUOTAS, Quotas
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.session import open_session
from services.console.http.recordings import Recordings
from services.recorder.answers import Answers
from services.recorder.serving import Serving
from tests.conftest import run
from tests.recordings import START_NS, Written, joints, write_recording

BASE = "robomesh/site/-/recordings"
JOINTS = "robomesh/site/arm/joints"


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "arm").mkdir()
    write_recording(tmp_path / "arm" / "trial.mcap")
    return tmp_path


@asynccontextmanager
async def served(mesh, folder, quotas=DEFAULT_QUOTAS, **open_now):
    """A recorder's answers, and somebody who asks."""
    async with open_session(mesh) as own, open_session(mesh) as asker:
        serving = Serving(own, "site", folder, open_now=lambda: open_now, flight=lambda: True, quotas=quotas)
        try:
            yield asker
        finally:
            await serving.close()


def test_a_recorder_whose_reader_is_held_up_says_that_it_is_busy_and_answers_later(mesh, folder):
    async def main():
        async with open_session(mesh) as own, open_session(mesh) as asker:
            serving = Serving(own, "site", folder, open_now=dict, flight=lambda: True)
            try:
                assert (await asker.ask(f"{BASE}/list", timeout_s=50.0)).recordings
                os.kill(serving.pid, signal.SIGSTOP)
                for _ in range(2):
                    with pytest.raises(BusyError, match="the recorder is busy: its recordings/list"):
                        await asker.ask(f"{BASE}/list", timeout_s=0.5)
                os.kill(serving.pid, signal.SIGCONT)
                assert (await asker.ask(f"{BASE}/list", timeout_s=50.0)).recordings
            finally:
                await serving.close()

    run(main())


def test_recordings_are_listed_ranged_and_refused_over_the_mesh(mesh, folder):
    (folder / "broken.mcap").write_text("no recording")

    async def main():
        writing = schema.Recording(file="zz.mcap", open=True)
        quotas = Quotas(recordings_mib_a_minute=1e-4)
        async with served(mesh, folder, quotas, **{"zz.mcap": writing}) as session:
            listed = await session.ask(f"{BASE}/list", timeout_s=20.0)
            info = await session.ask(f"{BASE}/info", schema.RecordingQuery(file="trial.mcap"))
            asked = schema.RangeRequest(file="trial.mcap", topic=JOINTS, most=10)
            asked.start.FromNanoseconds(START_NS + 1_000_000_000)
            messages = await session.ask(f"{BASE}/range/li", asked)
            with pytest.raises(QuotaError, match=r"recordings_mib_a_minute = 0\.0001 a name .* ask again in"):
                await session.ask(f"{BASE}/range/li", asked)
            with pytest.raises(RefusedError, match=r"no recording 'gone\.mcap' here"):
                await session.ask(f"{BASE}/info", schema.RecordingQuery(file="gone.mcap"))
            asked.start.FromNanoseconds(START_NS + 60_000_000_000)
            with pytest.raises(RefusedError, match=r"nothing from .* it goes from 2023-11-14"):
                await session.ask(f"{BASE}/range/wang", asked)
            return listed, info, messages

    listed, info, messages = run(main())
    assert [(row.file, row.open) for row in listed.recordings] == [
        ("zz.mcap", True),
        ("trial.mcap", False),
        ("broken.mcap", False),
    ]
    assert "does not begin as one" in listed.recordings[2].problem
    assert (listed.flight, listed.free_bytes > 0) == (True, True)
    assert {topic.topic: topic.messages for topic in info.topics}[JOINTS] == 400
    assert (messages.more, messages.schema, len(messages.messages)) == (True, "foxglove.JointStates", 10)
    assert JointStates.FromString(messages.messages[0].data).joints[0].position == 1.0


def test_video_can_be_asked_for_from_the_key_frame_before(folder):
    asked = schema.RangeRequest(file="trial.mcap", topic="robomesh/site/arm/video/front", from_key_frame=True)
    asked.start.FromNanoseconds(START_NS + 1_300_000_000)
    answer = Answers(folder).range(asked)
    assert answer.messages[0].received.ToNanoseconds() == START_NS + 1_000_000_000


def test_series_tell_what_there_is_and_what_it_was(folder):
    answers = Answers(folder)
    known = answers.series(schema.SeriesRequest(file="trial.mcap")).known
    assert "joints/waist/position" in known
    (waist,) = answers.series(
        schema.SeriesRequest(file="trial.mcap", values=["joints/waist/position"], points=100)
    ).series
    assert (min(waist.lowest), max(waist.highest), waist.unit) == (0.0, 3.99, "rad")


def test_pieces_keep_their_version_while_a_file_grows_and_not_when_it_is_written_again(tmp_path):
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
    again = write_recording(tmp_path / "again", chunked=True)
    again.replace(path)
    assert answers.piece(schema.PieceRequest(file="trial.mcap")).version != before.version


class _Direct:
    """A session whose recorder is this process, for the routes alone."""

    def __init__(self, folder):
        self._answers = Answers(folder)

    async def ask(self, key, request, *, timeout_s):
        from mcap_files.errors import RecordingError

        try:
            what = key.split("/recordings/")[1].removesuffix("/li")
            return getattr(self._answers, what)(request)
        except RecordingError as error:
            raise RefusedError(str(error)) from None


@dataclass
class _Answer:
    """What came of a request."""

    status_code: int
    headers: dict
    content: bytes

    @property
    def text(self):
        return self.content.decode()


class _Http:
    """The routes asked without a socket."""

    def __init__(self, app):
        self._app = app

    def get(self, path, headers=None, method="GET"):
        async def main():
            raw, _, query = path.partition("?")
            scope = {
                "type": "http",
                "method": method,
                "path": unquote(raw),
                "raw_path": raw.encode(),
                "query_string": query.encode(),
                "headers": [(key.lower().encode(), value.encode()) for key, value in (headers or {}).items()],
            }
            told, body = {}, bytearray()

            async def receive():
                await asyncio.get_running_loop().create_future()  # it stays to the end

            async def send(message):
                if message["type"] == "http.response.start":
                    told.update(message)
                else:
                    body.extend(message.get("body", b""))

            await self._app(scope, receive, send)
            named = {key.decode(): value.decode() for key, value in told["headers"]}
            return _Answer(told["status"], named, bytes(body))

        return run(main())

    def head(self, path):
        return self.get(path, method="HEAD")


@pytest.fixture
def http(folder):
    return _Http(Starlette(routes=Recordings(_Direct(folder), lambda _: "li").routes()))


def test_a_file_comes_whole_in_ranges_and_resumes_where_it_was_broken_off(http, folder):
    whole = (folder / "arm" / "trial.mcap").read_bytes()
    url = "/recordings/site/trial.mcap"
    answer = http.get(url)
    assert (answer.status_code, answer.content) == (200, whole)
    assert "filename*=UTF-8''trial.mcap" in answer.headers["content-disposition"]
    tag = answer.headers["etag"]
    head = http.head(url)
    assert (head.status_code, head.headers["content-length"], head.content) == (200, str(len(whole)), b"")
    for asked, begin, end in (
        ("bytes=100-199", 100, 200),
        ("bytes=1000-", 1000, len(whole)),
        ("bytes=-10", len(whole) - 10, len(whole)),
        ("bytes=0-99999999", 0, len(whole)),
    ):
        part = http.get(url, headers={"Range": asked, "If-Range": tag})
        assert (part.status_code, part.content) == (206, whole[begin:end])
        assert part.headers["content-range"] == f"bytes {begin}-{end - 1}/{len(whole)}"
    assert http.get(url, headers={"Range": "bytes=5-9", "If-Range": '"older"'}).content == whole
    for no_range in ("lines=5-9", "bytes=0-" + "9" * 5000):
        assert http.get(url, headers={"Range": no_range}).status_code == 200
    assert http.get(url, headers={"If-None-Match": tag}).status_code == 304
    beyond = http.get(url, headers={"Range": "bytes=99999999-"})
    assert (beyond.status_code, beyond.headers["content-range"]) == (416, f"bytes */{len(whole)}")


def test_what_is_not_there_is_refused_in_words_over_http(http):
    gone = http.get("/recordings/site/gone.mcap")
    assert (gone.status_code, "no recording 'gone.mcap' here" in gone.text) == (404, True)
    none = http.get("/recordings/site/trial.mcap/thumbnail.jpg")
    assert (none.status_code, "no attachment 'thumbnail.jpg'" in none.text) == (404, True)
    assert http.get("/recordings/site/..%2Ftrial.mcap").status_code == 404


@pytest.mark.parametrize(
    ("error", "status", "again"),
    [
        (QuotaError("li has had its minute's worth", again_s=30.2), 429, "31"),
        (BusyError("too many requests wait"), 503, "1"),
        (BrokenAnswerError("30000 of 90000 bytes came"), 504, None),
    ],
)
def test_over_http_it_is_told_when_to_ask_again(folder, error, status, again):
    async def refuse(*_, **__):
        raise error

    app = Starlette(routes=Recordings(SimpleNamespace(ask=refuse), lambda _: "li").routes())
    answer = _Http(app).get("/recordings/site/trial.mcap")
    assert (answer.status_code, answer.headers.get("retry-after"), answer.text) == (status, again, str(error))


def test_values_as_csv_equal_the_files_numbers(http, folder, monkeypatch):
    with Written(folder / "tool.mcap") as file:
        state = schema.KinematicState(tool_to_base=[1, 0, 0, 0.5, 0, 1, 0, 0.25, 0, 0, 1, 0.125, 0, 0, 0, 1])
        for number in range(100):
            if number == 10:
                file.put("kinematics", state, number / 100)
            file.put("joints", joints(waist=number / 7), number / 100)
    monkeypatch.setattr("services.console.http.recordings._ROWS", 7)  # many answers
    answer = http.get("/recordings/site/tool.mcap/values.csv")
    header, *rows = csv.reader(io.StringIO(answer.text))
    assert header[:5] == ["time", "received", "sequence", "t [s]", "waist [rad]"]
    assert [float(row[4]) for row in rows] == [number / 7 for number in range(100)]
    tool_x = header.index("tool x [m]")
    assert [row[tool_x] for row in rows] == [""] * 10 + ["0.5"] * 26 + [""] * 64
    published, received = "2023-11-14T22:13:20.009999000Z", "2023-11-14T22:13:20.010000000Z"
    assert rows[1][:4] == [published, received, "10", "0.009999000"]


def test_values_of_a_clock_that_stood_still_are_all_there_and_nonsense_is_left_out(http, folder, monkeypatch):
    nonsense = SimpleNamespace(SerializeToString=lambda: b"\xff")
    with Written(folder / "still.mcap") as file:
        for number in range(50):
            file.put("joints", joints(waist=number), 0.5)
            file.put("joints", joints(waist=number), 0.5)
            file.put("joints", nonsense, 0.5)
    monkeypatch.setattr("services.console.http.recordings._ROWS", 7)
    answer = http.get("/recordings/site/still.mcap/values.csv")
    _, *rows = csv.reader(io.StringIO(answer.text))
    # A row a state: equal times and values make no two states one.
    assert [float(row[4]) for row in rows] == [number for number in range(50) for _ in range(2)]


def test_a_thumbnail_is_a_picture_that_need_not_be_sent_twice(http, folder):
    with Written(folder / "seen.mcap") as file:
        file.put("joints", joints(waist=1), 0.0)
        file.attach("thumbnail.jpg", b"\xff\xd8picture", "image/jpeg")
    answer = http.get("/recordings/site/seen.mcap/thumbnail.jpg")
    assert (answer.headers["content-type"], answer.content) == ("image/jpeg", b"\xff\xd8picture")
    again = http.get(
        "/recordings/site/seen.mcap/thumbnail.jpg", headers={"If-None-Match": answer.headers["etag"]}
    )
    assert again.status_code == 304


def test_an_empty_file_has_its_names_word_and_time_and_says_that_nothing_was_written(tmp_path):
    (tmp_path / "arm").mkdir()
    empty = tmp_path / "arm" / "2026-11-21T20-55-01.500000Z_full.mcap"
    empty.touch()
    (row,) = Answers(tmp_path).list(schema.RecordingQuery()).recordings
    assert (row.robot, row.name, row.start.ToJsonString()) == ("arm", "full", "2026-11-21T20:55:01.500Z")
    assert "nothing was written" in row.problem


@pytest.mark.parametrize("seconds", [1 << 62, -(1 << 62), 253402300800])
def test_a_time_that_no_calendar_has_is_refused_in_words(folder, seconds):
    for field in ("start", "end"):
        asked = schema.RangeRequest(file="trial.mcap", topic=JOINTS)
        getattr(asked, field).seconds = seconds
        with pytest.raises(RecordingError, match=r"trial\.mcap: no time that there is"):
            Answers(folder).range(asked)
