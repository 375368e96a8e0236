"""Output of `robomesh video` and `robomesh snapshot` with a real renderer, as on a terminal."""

import asyncio
import json
import signal
import sys

import av
import cv2

from tests.conftest import run
from tests.renderer.renderer_site import moving, picture, renderer_site
from tests.site import robomesh


async def done(mesh, *arguments):
    words = (*map(str, arguments), "--connect", mesh.connect[0])
    ended = await asyncio.to_thread(robomesh, *words, timeout_s=120.0)
    return ended.returncode, ended.stdout, ended.stderr


def pictures(path):
    with av.open(str(path)) as file:
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def test_a_view_is_saved_as_video_and_picture_and_one_that_there_is_not_says_so(mesh, tmp_path):
    video, half, still = tmp_path / "arm.mp4", tmp_path / "half.mp4", tmp_path / "arm.png"

    async def main():
        async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
            robot.declare_presence("hall", "arm", "kinematics")
            await picture(monitor)
            saving = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "services.command_line.main"),
                *("video", "arm", "front", str(video), "--json", "--connect", mesh.connect[0]),
                stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE,
            )
            while not video.exists() or video.stat().st_size < 15_000:
                await asyncio.sleep(0.05)
            # It plays while it is written.
            half.write_bytes(video.read_bytes())
            saving.send_signal(signal.SIGINT)
            out, err = await saving.communicate()
            assert (saving.returncode, err) == (0, b"")
            told = json.loads(out)
            answers = [
                await done(mesh, "snapshot", "arm", "free", still, "--width", 400),
                *await asyncio.gather(
                    done(mesh, "video", "arm", "behind", tmp_path / "none.mp4"),
                    done(mesh, "snapshot", "arm", "behind", tmp_path / "none.png"),
                    done(mesh, "video", "arm", "free", tmp_path / "none.avi"),
                ),
                await done(
                    mesh, "video", "arm", "free", tmp_path / "small.mp4", "--seconds", 1, "--height", 120
                ),
            ]
            return told, answers

    told, (snapshot, no_video, no_picture, no_format, small) = run(main(), timeout_s=180.0)
    assert len(pictures(half)) > 1
    frames = pictures(video)
    assert len(frames) == told["pictures"] > 1
    assert told["pictures_per_s"] == told["pictures"] / told["duration_s"]
    assert told["bytes"] == video.stat().st_size
    assert frames[0].shape == (180, 320, 3)
    assert snapshot == (0, f"{still}\n", "")
    assert cv2.imread(str(still)).shape == (224, 400, 3)
    there_are = "robomesh: no view 'behind'; there are close, far, free, front, left, top\n"
    assert no_video == no_picture == (2, "", there_are)
    assert not (tmp_path / "none.mp4").exists()
    assert small[0] == 0
    assert " a second (up to 30 while it moves)" in small[1]
    assert pictures(tmp_path / "small.mp4")[0].shape[0] == 120
    assert no_format[0] == 2
    assert "video is written as .mp4" in no_format[2]
