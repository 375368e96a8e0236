"""Changes of a cell: the check, the picture, live clearance and the file change together or not at all."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from io import BytesIO

import coal
import numpy as np
import pytest
import trimesh

from protocol_gateway.cells import changes as cell_changes
from robomesh import reason_codes as codes
from robomesh.errors import RobomeshError
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.wire.session import open_session
from services.cells.file import CellFile
from services.kinematics.shown_cell import ShownCell
from tests.conftest import last_value, rest_is_long, run
from tests.protocol_gateway.gateway_site import A, C, GatewaySite, kept_control, simulator, until
from tests.refusals import refused
from tests.services.cell_site import CellSite, cell_site, write_site

# Where the tool of an arm at home is, in front of its base [m].
IN_THE_WAY_M = 0.45


@contextlib.asynccontextmanager
async def watched(site, *topics):
    """Collect the messages of topics."""
    seen = {name: [] for name in topics}

    async def take(name):
        async for sample in site.session.subscribe(site.key(name)):
            seen[name].append(sample.message())

    tasks = [asyncio.create_task(take(name)) for name in topics]
    try:
        yield seen
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def distance_by_coal(site):
    """Return the distance of the arm from the post: with coal alone, from what the mesh publishes [m]."""
    description = await last_value(site.session, site.key("description"))
    frames = await last_value(site.session, site.key("frames"))
    placements = {each.child_frame_id: each for each in frames.transforms}
    (fixture,) = description.fixtures
    post = np.reshape(fixture.fixture_to_site, (4, 4))
    box = coal.Box(0.1, 0.1, 1.0)
    found = []
    for link in description.links:
        if not link.mesh:
            continue
        glb = await site.session.ask_bytes(site.key(f"mesh/{link.mesh}"))
        scene = trimesh.load(BytesIO(glb), file_type="glb")
        placed = placements[f"hall/arm/{link.name}"]
        q, t = placed.rotation, placed.translation
        rotation = trimesh.transformations.quaternion_matrix([q.w, q.x, q.y, q.z])[:3, :3]
        # glTF's y is up; a link's frame has z up.
        vertices = scene.to_geometry().vertices @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
        points = coal.StdVec_Vec3s()
        points.extend(np.asarray(vertices))
        convex = coal.Convex.convexHull(points, True, "Qt")
        found.append(
            coal.distance(
                convex,
                coal.Transform3s(rotation, np.array([t.x, t.y, t.z])),
                box,
                coal.Transform3s(post[:3, :3], post[:3, 3]),
                coal.DistanceRequest(),
                coal.DistanceResult(),
            )
        )
    return min(found)


async def clearance(site, seen):
    """Return the arm's live clearance of the present content [m]."""
    count = len(seen["kinematics"])
    await until(lambda: len(seen["kinematics"]) > count + 2)
    return seen["kinematics"][-1].clearance.distance


@pytest.mark.slow
def test_check_picture_clearance_and_file_change_together(mesh, tmp_path):
    async def main():
        async with (
            cell_site(mesh, tmp_path) as site,
            watched(site, "kinematics", "controller", "joints", "events") as seen,
        ):
            operator = GatewaySite(site.session, tmp_path, seen=seen)
            before = await site.agreed()
            assert await clearance(site, seen) == pytest.approx(await distance_by_coal(site), abs=5e-3)
            with refused(codes.CELL_SAME):
                await site.ask(x=0.9)
            with refused(codes.CELL_OUTDATED):
                await site.ask(x=0.8, based_on="0" * 64)
            tried = await site.ask(x=0.8, dry_run=True)
            assert [(each.fixture, each.before, each.after) for each in tried.changes] == [
                ("post", "[900, 0, 500]", "[800, 0, 500]")
            ]
            assert await site.agreed() == before

            await operator.home()
            async with kept_control(operator):
                with refused(codes.CELL_CONTROLLED, holder="li"):
                    await site.ask(x=0.8)
                target = [0.6, *operator.joints[1:]]
                await operator.command(C.MOVE_ABSOLUTE, joint_positions=target)
                await until(lambda: np.allclose(operator.joints, target, atol=1e-3))
            await until(lambda: seen["controller"][-1].activity == schema.ControllerState.IDLE)
            await asyncio.sleep(1.0)  # a release before the motion has demonstrably ended latches a stop
            await operator.lease(A.RELEASE)

            answer = await changed_when_free(site, IN_THE_WAY_M)
            assert await site.agreed() == answer.version != before
            assert site.path.with_name("site.toml.1").is_file()
            assert await clearance(site, seen) == pytest.approx(await distance_by_coal(site), abs=5e-3)
            (entry,) = (each for each in entries(tmp_path) if each["request"] == "CELL" and accepted(each))
            assert entry["operator"] == "wang"
            assert entry["values"]["reason"] == "the post was moved"
            assert entry["text"] == "post: xyz [900, 0, 500] -> [450, 0, 500]"
            assert [each for each in seen["events"] if getattr(each, "code", "") == "cell.changed"]

            # The way back to home passes the post's new place.
            await operator.lease(A.ACQUIRE, ttl_s=5)
            with refused(codes.CHECK_ON_ITS_WAY):
                await operator.command(C.MOVE_ABSOLUTE, joint_positions=[-0.6, *target[1:]])
            await operator.lease(A.RELEASE)

            state = await site.state()
            await site.ask(content=state.previous)
            assert await site.agreed() == before

            with site.path.open("a") as file:
                file.write("# by hand\n")
            with refused(codes.CELL_FILE_CHANGED):
                await site.ask(x=0.8)
            assert (await site.state()).problem.code == codes.CELL_FILE_CHANGED.name

    run(main(), timeout_s=300.0)


async def changed_when_free(site, x):
    """Change the cell as soon as the gateway has seen that the arm rests."""
    while True:
        try:
            return await site.ask(x=x)
        except RobomeshError as error:
            if error.reason.code not in ("cell.moves", "cell.unknown"):
                raise
            await asyncio.sleep(0.1)


def entries(folder):
    lines = (folder / "audit" / "hall" / "arm.jsonl").read_text().splitlines()
    return [json.loads(line) for line in lines]


def accepted(entry):
    return entry["outcome"] == "ACCEPTED"


@pytest.mark.slow
def test_during_a_change_there_is_no_control_but_a_stop(mesh, tmp_path, monkeypatch):
    saving, go_on = threading.Event(), threading.Event()
    save = CellFile.save

    def slow_save(*arguments):
        saving.set()
        assert go_on.wait(60.0)
        save(*arguments)

    monkeypatch.setattr(CellFile, "save", slow_save)

    async def main():
        async with cell_site(mesh, tmp_path) as site:
            operator = GatewaySite(site.session, tmp_path)
            change = asyncio.create_task(site.ask(x=0.8))
            assert await asyncio.to_thread(saving.wait, 60.0)
            assert (await site.state()).changing
            with refused(codes.CELL_CHANGES, operator="wang"):
                await operator.lease(A.ACQUIRE, ttl_s=5)
            with refused(codes.CELL_CHANGES):
                await site.ask(x=0.7)
            assert (await operator.stop(by="li")).sent
            go_on.set()
            await change
            await site.agreed()
            assert (await operator.lease(A.ACQUIRE, ttl_s=5)).lease

    try:
        run(main(), timeout_s=240.0)
    finally:
        go_on.set()


@pytest.mark.slow
def test_a_change_that_kinematics_does_not_show_is_taken_back(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr(cell_changes, "SHOWN_WITHIN_S", 0.5)

    async def main():
        async with cell_site(mesh, tmp_path) as site:
            before, text = await site.agreed(), site.path.read_bytes()
            with monkeypatch.context() as patch:

                async def ignore(*_):
                    pass

                patch.setattr(ShownCell, "take", ignore)
                with refused(codes.CELL_TAKEN_BACK):
                    await site.ask(x=0.8)
            assert await site.agreed() == before
            assert site.path.read_bytes() == text
            assert not site.path.with_name("site.toml.1").exists()
            outcomes = [each["outcome"] for each in entries(tmp_path) if each["request"] == "CELL"]
            assert outcomes == ["ACCEPTED", "FAILED"]

    run(main(), timeout_s=240.0)


# Programs that run a service and kill it at one place.
DIES = """
import os, signal, sys
from services.command_line.main import main
{patch}
sys.argv[0] = "robomesh"
main()
"""
BEFORE_SAVE = """
from services.cells.file import CellFile
CellFile.save = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
"""
AFTER_SAVE = """
from services.cells.file import CellFile
save = CellFile.save
CellFile.save = lambda *given: (save(*given), os.kill(os.getpid(), signal.SIGKILL))
"""
BEFORE_SHOWN = """
from services.kinematics.answers import Workers
async def die(*_):
    os.kill(os.getpid(), signal.SIGKILL)
Workers.replace_cells = die
"""
WHILE_PREPARING = """
from services.kinematics.shown_cell import ShownCell
ShownCell._made = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
"""
KILLS = {
    "gateway before the file is saved": ("gateway", BEFORE_SAVE, "old"),
    "kinematics while it prepares the change": ("kinematics", WHILE_PREPARING, "either"),
    "gateway after the file is saved": ("gateway", AFTER_SAVE, "new"),
    "kinematics before it shows the change": ("kinematics", BEFORE_SHOWN, "either"),
}


@pytest.mark.processes
@pytest.mark.parametrize("name", rest_is_long(2, KILLS))
def test_after_a_kill_all_agree(mesh, tmp_path, name):
    victim, patch, outcome = KILLS[name]
    path = write_site(tmp_path)
    path.write_text(f'{path.read_text()}\n[audit]\nfolder = "{tmp_path}/audit"\n')
    (router,) = mesh.connect
    running = {}

    def start(service, port, text=""):
        more = ("--controller", f"arm=tcp://127.0.0.1:{port}") if service == "gateway" else ()
        code = DIES.format(patch=text)
        words = [sys.executable, "-c", code, service, "--site", str(path), "--connect", router, *more]
        running[service] = subprocess.Popen(words)

    async def main():
        async with simulator() as port, open_session(mesh) as session:
            site = CellSite(session, path)
            for service in ("gateway", "kinematics"):
                start(service, port, patch if service == victim else "")
            async with watched(site, "controller") as seen:
                await until(lambda: seen["controller"] and seen["controller"][-1].link == 1, 60.0)
            before = await eventually(site)
            change = asyncio.create_task(changed_when_free(site, 0.8))
            assert await asyncio.to_thread(running[victim].wait, 90.0) == -signal.SIGKILL
            if victim == "gateway":
                # The client's library asks the next gateway again.
                change.cancel()
            start(victim, port)
            with contextlib.suppress(RobomeshError, asyncio.CancelledError):
                await change
            after = await eventually(site)
            # A slow restart of kinematics lets the gateway take the change back.
            assert outcome == "either" or (after == before) == (outcome == "old"), await site.versions()

    try:
        run(main(), timeout_s=300.0)
    finally:
        for process in running.values():
            with contextlib.suppress(ProcessLookupError):
                os.kill(process.pid, signal.SIGKILL)
            process.wait()


async def eventually(site):
    """Return the version on which all agree, when every service runs."""
    async with asyncio.timeout(90.0):
        while True:
            with contextlib.suppress(AttributeError, AssertionError, RobomeshError, TimeoutError):
                return await site.agreed()
            await asyncio.sleep(0.1)
