"""A video of a part of a recording: rendered by the site, followed, cancelled, and cleaned up."""

import asyncio
import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from starlette.applications import Starlette

from services.console.http import recorded_video
from services.console.http.recorded_video import RecordedVideo
from tests.conftest import run
from tests.recordings import write_recording
from tests.services.http_refusals import read_refusal
from tests.services.test_recordings_served import _Direct, _Http

URL = "/recordings/site/trial.mcap/video"
SLOW = """
import os, sys, time
from pathlib import Path
from robomesh.files.worker import answer_all, report
def render(question):
    Path(question[1]).write_bytes(b"part")
    Path({pid!r}).write_text(str(os.getpid()))
    report(0.5)
    time.sleep(600)
answer_all(lambda _: render)
"""


@pytest.fixture
def videos(tmp_path, monkeypatch):
    """Return the routes' object, over a recorder of this process, with its own folder."""
    (tmp_path / "arm").mkdir()
    write_recording(tmp_path / "arm" / "trial.mcap")
    place = tmp_path / "place"
    place.mkdir()
    monkeypatch.setattr(recorded_video, "_PLACE", str(place))
    made = RecordedVideo(_Direct(tmp_path), lambda _: "li")
    return SimpleNamespace(made=made, app=Starlette(routes=made.routes()), place=place)


def files(place):
    return sorted(path.name for path in place.glob("*/*") if path.name != ".lock")


def is_running(pid):
    return Path(f"/proc/{pid.read_text()}").exists()


@pytest.mark.parametrize(
    ("query", "status", "code"),
    [
        ("from=5&to=1", 400, "recording.span"),
        ("view=a/b", 400, "request.invalid"),
    ],
)
def test_an_invalid_part_or_view_is_refused_before_anything_is_made(query, status, code, videos):
    answer = run(_Http(videos.app).request(f"{URL}?{query}", method="POST"))
    assert answer.status_code == status
    assert read_refusal(answer.headers, answer.content).code == code
    assert not files(videos.place)


@pytest.mark.slow
def test_a_recording_without_a_description_fails_with_its_reason_and_leaves_no_file(videos):
    answer = run(_Http(videos.app).request(URL, method="POST"))
    *_, last = [json.loads(line) for line in answer.content.splitlines()]
    assert last["state"] == "failed"
    assert "description" in last["refusal"]["text"]
    assert not files(videos.place)


@pytest.mark.slow
async def test_a_page_that_leaves_ends_the_process_and_its_files(videos, monkeypatch, tmp_path):
    pid = tmp_path / "pid"
    (tmp_path / "slow_render.py").write_text(SLOW.format(pid=str(pid)))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(recorded_video, "_MODULE", "slow_render")
    request = asyncio.create_task(_Http(videos.app).request(URL, method="POST"))
    while not pid.exists() or not pid.read_text():
        await asyncio.sleep(0.02)
    assert len(files(videos.place)) == 2
    request.cancel()
    await asyncio.gather(request, return_exceptions=True)
    while files(videos.place) or is_running(pid):
        await asyncio.sleep(0.02)
    await videos.made.close()
    assert not list(videos.place.iterdir())


async def test_the_files_of_a_killed_console_are_removed_by_the_next(videos):
    left = videos.place / "robomesh-video-killed"
    left.mkdir()
    (left / ".lock").touch()
    (left / "x.mp4").write_bytes(b"x")

    other = RecordedVideo(None, lambda _: "li")
    running = other._own_folder()
    videos.made._own_folder()
    assert not left.exists()
    assert running.exists()
    await other.close()
    await videos.made.close()
