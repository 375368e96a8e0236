"""Requested views with the real renderer: shared, limited, and ended without subscribers."""

import asyncio
import io

import av
import numpy as np
import pytest
from foxglove_schemas_protobuf.CompressedVideo_pb2 import CompressedVideo

from renderer.encoding.mp4 import FragmentedMp4
from renderer.service import renderer
from robomesh import reason_codes as codes
from robomesh.contract.quotas import Quotas
from robomesh.errors import QuotaError, RefusedError
from robomesh.schemas.robomesh_pb2 import Description, KeyFrameRequest, Vector3, View, ViewAnswer, ViewRequest
from robomesh.wire.session import open_session
from tests.conftest import last_value
from tests.refusals import refused
from tests.renderer.renderer_site import frames, moving, picture, renderer_site

ARM = "robomesh/hall/arm"
BESIDE = View(
    eye=Vector3(x=2.0, y=0.6, z=0.8), target=Vector3(z=0.45), projection=View.PERSPECTIVE, up=Vector3(z=1.0)
)


async def ask(monitor, asker="li", timeout_s=40.0, **fields):
    answer = await monitor.ask(f"{ARM}/views/{asker}", ViewRequest(**fields), timeout_s=timeout_s)
    assert isinstance(answer, ViewAnswer)
    return answer


async def packets(subscription, count):
    found = []
    async for sample in subscription:
        message = sample.message()
        assert isinstance(message, CompressedVideo)
        found.append((sample, message.data))
        if len(found) == count:
            return found
    raise AssertionError("the subscription ended")


async def test_a_requested_view_is_drawn_shared_and_ends_without_subscribers(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(renderer, "_NEXT_WATCHER_WITHIN_S", 0.3)
    monkeypatch.setattr(renderer, "_FIRST_WATCHER_WITHIN_S", 8.0)
    async with renderer_site(mesh, tmp_path, most_views=1) as (robot, monitor), moving(robot):
        await picture(monitor)
        answer = await ask(monitor, view=BESIDE, width=240, height=200, fps=25.0)
        assert (answer.width, answer.height, answer.fps) == (240, 200, 25.0)
        assert answer.topic.startswith("video/free-")
        # The camera's name does not matter.
        named = View()
        named.CopyFrom(BESIDE)
        named.name = "mine"
        assert await ask(monitor, view=named, width=240, height=200, fps=25.0) == answer
        with refused(codes.VIEWS_TOO_MANY, count="1"):
            await ask(monitor, of="top", width=240, height=200)
        # The renderer's own views do not count.
        for name in ("front", "top", "left", "free", "close", "far"):
            answer_of_own = await ask(monitor, of=name)
            assert (answer_of_own.topic, answer_of_own.image) == (f"video/{name}", f"image/{name}")

        video = monitor.subscribe(f"{ARM}/{answer.topic}", newest=100, history=False)
        mp4 = FragmentedMp4()
        data = b"".join(
            mp4.add(packet, round(sample.received * 1e9)) for sample, packet in await packets(video, 20)
        )
        with av.open(io.BytesIO(data)) as file:
            seen = [frame.to_ndarray(format="rgb24").astype(int) for frame in file.decode(video=0)]
        assert len(seen) == 20
        assert seen[0].shape == (200, 240, 3)
        assert (np.abs(seen[2] - seen[-1]) > 40).any()
        assert (await picture(monitor, answer.image.removeprefix("image/"))).shape == (200, 240, 3)

        video.close()
        # The view has ended, so another one is possible.
        async with asyncio.timeout(40):
            while True:
                try:
                    await ask(monitor, of="top", width=240, height=200)
                    break
                except RefusedError:
                    await asyncio.sleep(0.1)
        assert await monitor.last(f"{ARM}/{answer.image}", timeout_s=0.3) is None


async def test_an_invalid_request_is_rejected_and_does_not_affect_others(mesh, tmp_path):
    quotas = Quotas(views=1, key_frames_a_minute=1.0)
    site = renderer_site(mesh, tmp_path, most_views=4, quotas=quotas)
    async with site as (robot, monitor), moving(robot):
        await picture(monitor)
        video = monitor.subscribe(f"{ARM}/video/front", newest=100, history=False)
        await frames(video, 3)
        full_hd = {"of": "front", "width": 1920, "height": 1080, "fps": 60.0}
        for fields, code, says in (
            ({"of": "behind"}, "view.unknown", "no view 'behind'"),
            ({"of": "front", "width": 5000, "height": 5000}, "view.invalid", "5000 x 5000"),
            (full_hd, "view.invalid", "million pixels a second"),
            ({"view": View(projection=View.PERSPECTIVE)}, "view.invalid", "eye and target are both at"),
            ({"view": View()}, "request.invalid", "PERSPECTIVE, ORTHOGRAPHIC"),
            ({"of": "front", "fps": float("nan")}, "request.invalid", "finite"),
        ):
            with pytest.raises(RefusedError) as caught:
                await ask(monitor, **fields)
            assert (caught.value.reason.code, says in str(caught.value)) == (code, True), fields
        # Quotas of operators are independent.
        mine = await ask(monitor, of="top", width=240, height=200)
        assert await ask(monitor, of="top", width=240, height=200) == mine
        with pytest.raises(QuotaError, match="no capacity: li already has 1 views: quota views = 1"):
            # A longer request would wait until the other view, which nobody watches, has ended.
            await ask(monitor, of="left", width=240, height=200, timeout_s=3.0)
        await ask(monitor, "wang", of="left", width=240, height=200)
        key = f"{ARM}/video/front/keyframe"
        while not (await monitor.ask(f"{key}/li", KeyFrameRequest())).forced:
            await asyncio.sleep(0.05)
        with pytest.raises(QuotaError, match="key_frames_a_minute = 1 for each name"):
            await monitor.ask(f"{key}/li", KeyFrameRequest())
        await monitor.ask(f"{key}/wang", KeyFrameRequest())
        await frames(video, 3)


async def test_a_robot_that_cannot_be_drawn_does_not_affect_others(mesh, tmp_path):
    async with renderer_site(mesh, tmp_path) as (robot, monitor), moving(robot):
        await picture(monitor)
        known = await last_value(monitor, f"{ARM}/description")
        assert isinstance(known, Description)
        broken = Description()
        broken.CopyFrom(known)
        del broken.fixtures[:]
        broken.fixtures.add(name="box", mesh="box", mesh_sha256="0", fixture_to_site=[1.0, 2.0])
        robot.declare_publisher("hall", "broken", "description").put(broken)
        video = monitor.subscribe(f"{ARM}/video/front", newest=100, history=False)
        await frames(video, 10)


async def test_a_replay_is_drawn_and_removed_with_its_player(mesh, tmp_path, monkeypatch):
    async with (
        renderer_site(mesh, tmp_path) as (robot, monitor),
        moving(robot),
        open_session(mesh) as player,
    ):
        await picture(monitor)
        live = await last_value(monitor, f"{ARM}/description")
        assert isinstance(live, Description)
        live.replay.id = "x"
        token = player.declare_presence_of("hall", "replay-x", "player", "1")
        description = player.declare_publisher("hall", "replay-x", "description")
        description.put(live)
        replay = "robomesh/hall/replay-x"
        async with asyncio.timeout(40):
            while await monitor.last(f"{replay}/image/front", timeout_s=1.0) is None:
                pass
        description.close()
        token.undeclare()
        async with asyncio.timeout(40):
            while await monitor.last(f"{replay}/image/front", timeout_s=0.5) is not None:
                pass
        # The live robot, which has the same shapes, remains.
        await picture(monitor)
