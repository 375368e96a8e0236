"""`robomesh recordings`: tables, video and plots of a recording, and refusals of bad input."""

import asyncio
import csv
import json
import math
import sys
from datetime import datetime

import av
import numpy as np
import pytest

from robomesh.errors import QuotaError
from robomesh.recordings.series.downsampling import Series
from robomesh.recordings.writing.capture import Capture
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.command_line.main import run
from services.command_line.record.export import plots
from services.command_line.record.export.output import atomic_file
from services.recorder.reading.serving import RecordingServer
from tests.conftest import run as run_async
from tests.recordings import START_NS, Written, joints, write_recording, write_swinging_arm

SIZE, FPS = (160, 120), 10


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    return write_swinging_arm(tmp_path_factory.mktemp("moving") / "moving.mcap")


def test_a_table_holds_the_files_numbers(moving, tmp_path, capsys):
    out = tmp_path / "out.csv"
    assert run(["recordings", "export", str(moving), str(out), "--from", "0.5", "--to", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 51
    with out.open() as stream:
        header, *rows = csv.reader(stream)
    waist = header.index("waist [rad]")
    assert [float(row[waist]) for row in rows] == [math.sin(number / 100) for number in range(50, 101)]
    # Published a microsecond before they were received.
    at_s = [float(row[header.index("t [s]")]) for row in rows]
    assert at_s == pytest.approx([number / 100 - 1e-6 for number in range(50, 101)], abs=1e-8)


def test_a_table_has_one_row_for_each_joint_state(tmp_path):
    source, out = tmp_path / "trial.mcap", tmp_path / "out.csv"
    with Written(source) as file:
        # Last values from before the recording all have its start time, oldest first.
        for waist in (0.1, 0.2, 0.3):
            file.put("joints", joints(waist=waist), 0.0)
        file.put("kinematics", schema.KinematicState(tool_to_base=range(16)), 0.0)
        file.put("joints", joints(waist=0.4), 0.01)
        file.put("joints", joints(waist=0.4), 0.01)
        file.put("joints", schema.RecorderRequest(name="\x07"), 0.02)  # a message of the wrong type
        file.put("joints", joints(waist=0.4), 0.02)
    assert run(["recordings", "export", str(source), str(out)]) == 0
    with out.open() as stream:
        header, *rows = csv.reader(stream)
    column = [header.index(name) for name in ("t [s]", "waist [rad]", "tool x [m]")]
    assert [[float(row[index]) for index in column] for row in rows] == [
        pytest.approx([at_s, waist, 3.0], abs=2e-6)
        for at_s, waist in ((0.0, 0.1), (0.0, 0.2), (0.0, 0.3), (0.01, 0.4), (0.01, 0.4), (0.02, 0.4))
    ]


@pytest.mark.slow
def test_video_is_rendered_from_the_joints(moving, tmp_path):
    out = tmp_path / "out.mp4"
    size = "x".join(map(str, SIZE))
    assert (
        run(
            [
                "recordings",
                "export",
                str(moving),
                str(out),
                "--size",
                size,
                "--fps",
                str(FPS),
                "--view",
                "top",
            ]
        )
        == 0
    )
    with av.open(str(out)) as video:
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in video.decode(video=0)]
        (stream,) = video.streams
        assert (stream.width, stream.height) == SIZE
    assert len(frames) == 2 * FPS + 1
    assert np.abs(frames[0] - frames[12]).max() > 60


def test_a_view_that_was_not_recorded_is_refused(tmp_path, capsys):
    source = write_recording(tmp_path / "trial.mcap")
    assert run(["recordings", "export", str(source), str(tmp_path / "out.mp4"), "--recorded", "top"]) == 2
    assert "no video/top in it; it has" in capsys.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["trial.mcap"]


@pytest.mark.slow
def test_plots_mark_events(moving, tmp_path):
    out = tmp_path / "out.svg"
    assert run(["recordings", "export", str(moving), str(out)]) == 0
    text = out.read_text()
    assert text.startswith("<?xml")
    assert "#b37400" in text  # the warning's mark
    assert "<!-- odd -->" in text  # its code
    assert f"<!-- site/arm   moving   {datetime.fromtimestamp(START_NS * 1e-9).astimezone():%Y-%m-%d}" in text


def test_a_plot_has_no_line_where_nothing_was_recorded():
    times_s = np.concatenate([np.arange(0, 2, 0.1), np.arange(10, 12, 0.1)])
    series = Series("joints/waist/position", "rad", times_s, times_s, times_s)
    axes = pytest.importorskip("matplotlib.figure").Figure().subplots()
    plots._draw(axes, "joints", [series], between_s=0.15)
    drawn = axes.lines[0].get_xdata()
    assert np.flatnonzero(np.isnan(drawn)).tolist() == [20]
    axes = pytest.importorskip("matplotlib.figure").Figure().subplots()
    plots._draw(axes, "joints", [series], between_s=9.0)  # points of a long recording are far apart
    assert not np.isnan(axes.lines[0].get_xdata()).any()


def test_a_plot_of_too_many_values_shows_the_first_64(tmp_path):
    source, out = tmp_path / "trial.mcap", tmp_path / "out.svg"
    with Written(source) as file:
        for at_s in (0.0, 1.0):
            file.put("joints", joints(**{f"j{number}": at_s for number in range(66)}), at_s)
    assert run(["recordings", "export", str(source), str(out)]) == 0
    assert "<!-- the first 64 of 66 -->" in out.read_text()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["out.txt"], "the name must end in .csv (joints and tool), .mp4 (video)"),
        (["out.csv", "--from", "9"], "--from 9: moving.mcap goes from 0 to 2.000 s"),
        (["out.mp4", "--view", "inside"], "no view 'inside'; there are"),
        (["out.mp4", "--size", "161x120"], "--size 161x120: even, and from 64 to 4096 a side"),
        (["out.mp4", "--size", "big"], "--size big: must be WIDTHxHEIGHT"),
        (["out.mp4", "--fps", "0"], "--fps 0: must be 1 to 120"),
        (["none/out.csv"], "cannot be written: No such file or directory"),
    ],
)
@pytest.mark.slow
def test_a_refused_export_prints_one_line_and_leaves_no_file(moving, tmp_path, capsys, arguments, text):
    name, *options = arguments
    assert run(["recordings", "export", str(moving), str(tmp_path / name), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert text in line
    assert not list(tmp_path.iterdir())


def test_every_command_refuses_a_file_that_is_not_a_recording(tmp_path, capsys):
    text = tmp_path / "notes.mcap"
    text.write_text("not a recording")
    for command in (["info", str(text)], ["export", str(text), "out.csv"], ["recover", str(text)]):
        assert run(["recordings", *command]) == 2
        assert "notes.mcap: not an MCAP file: its first bytes are wrong" in capsys.readouterr().err


def test_an_interrupted_write_leaves_no_file(tmp_path):
    out = tmp_path / "out.csv"

    def write():
        with atomic_file(out) as partial:
            partial.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert not list(tmp_path.iterdir())


def test_a_cut_file_is_recovered_once(tmp_path, capsys):
    path = write_recording(tmp_path / "trial.mcap", chunked=False)
    path.write_bytes(path.read_bytes()[:-30_000])
    assert run(["recordings", "recover", str(path)]) == 0
    assert "recovered" in capsys.readouterr().out
    assert run(["recordings", "info", str(path), "--json"]) == 0
    info = json.loads(capsys.readouterr().out)
    assert (info["problem"], info["recovered"]) == ("", True)
    assert run(["recordings", "recover", str(path)]) == 0
    assert "complete already" in capsys.readouterr().out


def test_recovery_of_an_open_recording_is_refused(tmp_path, capsys):
    path = tmp_path / "trial.mcap"
    capture = Capture(path, {"site": "hall", "robot": "arm", "name": "trial"}, start_ns=START_NS)
    try:
        capture.write_out()
        before = path.stat().st_ino, path.read_bytes()
        assert run(["recordings", "recover", str(path)]) == 2
        assert "trial.mcap: is still being recorded" in capsys.readouterr().err
        assert (path.stat().st_ino, path.read_bytes()) == before
        assert run(["recordings", "info", str(path), "--json"]) == 0
        info = json.loads(capsys.readouterr().out)
        assert (info["open"], info["problem"]) == (True, "")
    finally:
        capture.finish({})


def test_a_recording_of_a_site_has_one_name_for_every_command(mesh, router, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("robomesh.client.recordings.recorder_file._LONGEST_WAIT_S", 0.1)
    refusals = [None, QuotaError("more than one name may have: ask again in 30.0 s", again_s=30.0)]

    def check(client):
        if refusals and (error := refusals.pop(0)):
            raise error

    folder = tmp_path / "recordings"
    (folder / "arm").mkdir(parents=True)
    source = write_recording(folder / "arm" / "2026_trial.mcap", seconds=0.5)

    async def main():
        async with open_session(mesh) as service:
            server = RecordingServer(service, "site", folder, open_now=dict, flight=lambda: False)
            monkeypatch.setattr(server._mebibytes, "check", check)
            service.declare_presence("site", "-", "recorder")
            try:
                for recording, command in (
                    ("site/2026_trial", ["info"]),
                    ("2026_trial.mcap", ["fetch", str(tmp_path)]),
                    ("2026_trial", ["export", str(tmp_path / "out.csv")]),
                ):
                    name, *more = command
                    arguments = ["recordings", name, recording, *more, "--connect", router]
                    assert await asyncio.to_thread(run, arguments) == 0, capsys.readouterr().err
                assert await asyncio.to_thread(run, ["recordings", "info", "no", "--connect", router]) == 2
                assert await asyncio.to_thread(run, ["recordings", "list", "--connect", router]) == 0
            finally:
                await server.close()

    run_async(main())
    printed = capsys.readouterr()
    assert "site/arm/joints: 50" in printed.out
    assert "site/arm/video/front: 10, 20.4 pictures/s" in printed.out
    header, row, _ = printed.out.splitlines()[-3:]
    assert header.split() == ["recorded", "length", "size", "robot", "name"]
    assert row.split()[-3:] == ["MB", "site/arm", "2026_trial"]
    assert "2026_trial.mcap waits: more than one name may have: ask again in 30.0 s" in printed.err
    assert "no recording 'no', neither a file of this machine nor in robomesh recordings list" in printed.err
    assert (tmp_path / "2026_trial.mcap").read_bytes() == source.read_bytes()
    assert len((tmp_path / "out.csv").read_text().splitlines()) == 51


def test_a_silent_recorder_does_not_hide_the_recordings_of_others(mesh, router, capsys):
    async def main():
        async with open_session(mesh) as service:

            async def list_(_):
                return schema.RecordingList(recordings=[schema.Recording(name="trial", robot="arm")])

            service.answer("site", "-", "recordings/list", list_)
            for site in ("site", "silent"):
                service.declare_presence(site, "-", "recorder")
            assert await asyncio.to_thread(run, ["recordings", "list", "--connect", router]) == 0

    run_async(main())
    printed = capsys.readouterr()
    assert "site/arm" in printed.out
    assert "without the recordings of silent" in printed.err


def test_a_recorder_cannot_choose_the_folder_of_a_fetched_file(mesh, router, tmp_path, capsys):
    folder = tmp_path / "own"
    folder.mkdir()

    async def main():
        async with open_session(mesh) as service:

            async def list_(_):
                return schema.RecordingList(recordings=[schema.Recording(name="trial", file="../taken.mcap")])

            async def piece(_):
                return schema.Piece(data=b"x", total=1, version="1")

            service.answer("site", "-", "recordings/list", list_)
            service.answer("site", "-", "recordings/piece/*", piece)
            service.declare_presence("site", "-", "recorder")
            arguments = ["recordings", "fetch", "trial", str(folder), "--connect", router]
            assert await asyncio.to_thread(run, arguments) == 2

    run_async(main())
    assert "'../taken.mcap', which is not a plain file name" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["own"]
    assert not list(folder.iterdir())


def test_the_play_command_ends_when_its_player_goes_offline(mesh, router):
    async def main():
        async with open_session(mesh) as service:

            async def list_(_):
                return schema.RecordingList(recordings=[schema.Recording(name="trial", file="trial.mcap")])

            async def open_(_):
                return schema.ReplayState(robot="replay-x", file="trial.mcap")

            service.answer("site", "-", "recordings/list", list_)
            service.answer("site", "-", "player/open", open_)
            service.declare_presence("site", "-", "recorder")
            playing = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "services.command_line.main"),
                *("recordings", "play", "trial", "--connect", router),
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
            )
            try:
                _, printed = await playing.communicate()
            finally:
                if playing.returncode is None:
                    playing.kill()
                    await playing.wait()
            assert (playing.returncode, b"its player is gone" in printed) == (2, True), printed

    run_async(main())
