"""Define's workers: a file that makes one hang, crash or grow affects no other job."""

import asyncio
import contextlib
import os
import shutil
import signal
import subprocess
import threading
from types import SimpleNamespace

import pytest
from starlette.requests import Request

from robots.descriptions.description import load
from robots.descriptions.urdf.write import to_urdf
from services.console.accounts.sessions import SignedIn
from services.console.common.errors import RefusedRequest
from services.console.define import routes, store
from services.console.define.worker_pool import ConfinedWorker, Limits, Workers, Workshop
from tests.conftest import run
from tests.robots.test_step import step_box
from tests.services.defining import defining
from tests.site import alive, wait_until

POINTS = b"#VRML V2.0 utf8\nShape { geometry PointSet { coord Coordinate { point [ %s ] } } }\n"
LIMITS = Limits(quick_s=5.0, slow_s=5.0)


def workers() -> list[int]:
    """Return the process ids of this process's workers, oldest first."""
    found = subprocess.run(
        ["ps", "-ww", "--ppid", str(os.getpid()), "-o", "pid=,args="], capture_output=True, text=True
    ).stdout
    return [int(line.split()[0]) for line in found.splitlines() if "define.worker" in line]


@pytest.fixture
def page(mesh, tmp_path):
    with defining(mesh, tmp_path, limits=LIMITS) as page:
        yield page


def test_a_hanging_worker_is_ended_and_the_next_request_is_answered(page):
    draft = page.draft()
    mesh = {"file": "meshes/base.wrl", "files": draft["files"]}
    assert page.post("/check", draft).status == 200
    (quick,) = workers()
    assert page.post("/mesh", mesh).status == 200
    (slow,) = set(workers()) - {quick}
    os.kill(slow, signal.SIGSTOP)
    answers = []
    request_thread = threading.Thread(
        target=lambda: answers.append(page.post("/mesh", mesh | {"file": "meshes/wrist.wrl"}))
    )
    request_thread.start()
    # Typing continues during it.
    assert page.post("/check", draft).status == 200
    assert request_thread.is_alive()
    request_thread.join(30.0)
    assert (answers[0].status, answers[0].code) == (422, "define.too_slow")
    assert answers[0].json["text"] == "this took more than 5 s and was stopped"
    assert not alive(slow)
    assert page.post("/mesh", mesh | {"file": "meshes/forearm.3ds"}).status == 200


def test_a_killed_worker_is_replaced(page):
    draft = page.draft()
    assert page.post("/check", draft).status == 200
    (first,) = workers()
    os.kill(first, signal.SIGSTOP)
    answers = []
    request_thread = threading.Thread(target=lambda: answers.append(page.post("/check", draft)))
    request_thread.start()
    # Before or after the worker has read the request: both must work.
    os.kill(first, signal.SIGKILL)
    request_thread.join(30.0)
    assert answers[0].status == 200
    (second,) = workers()
    os.kill(second, signal.SIGKILL)
    assert page.post("/check", draft).status == 200


def test_a_request_that_crashes_every_worker_is_refused(mesh, tmp_path):
    # The limit is too small even for the libraries.
    with defining(mesh, tmp_path, limits=Limits(memory_bytes=20 * 1024**2)) as page:
        answer = page.post("/check", page.draft())
        assert (answer.status, answer.code) == (422, "define.crashed")
        assert page.get("/robots").status == 200


def test_a_file_that_needs_too_much_memory_is_refused(mesh, tmp_path):
    limits = Limits(memory_bytes=400 * 1024**2)
    with defining(mesh, tmp_path, limits=limits) as page:
        sha = page.upload(POINTS % (b"1 2 3 " * 6_000_000))
        answer = page.post("/mesh", {"file": "a.wrl", "files": {"a.wrl": sha}})
        assert (answer.status, answer.code) == (422, "define.memory")
        assert page.post("/check", page.draft()).json["problems"] == []


def test_a_hanging_workers_children_are_killed_with_it(mesh, tmp_path):
    with defining(mesh, tmp_path, limits=Limits(slow_s=4.0)) as page:
        # Open CASCADE, in a child process of the worker, hangs on an invalid length.
        endless = step_box((10, 20, 30)).replace("10.000000", "nan").encode()
        answer = page.post("/mesh", {"file": "a.step", "files": {"a.step": page.upload(endless, "a.step")}})
        assert (answer.status, answer.code) == (422, "define.too_slow")
        assert answer.json["text"] == "this took more than 4 s and was stopped"

        def nothing_runs():
            everything = subprocess.run(["ps", "-ww", "-eo", "args="], capture_output=True, text=True).stdout
            return str(tmp_path) not in everything

        # A killed process ends a moment later.
        wait_until(nothing_runs)


def test_no_worker_outlives_the_console(mesh, tmp_path):
    with defining(mesh, tmp_path) as page:
        page.post("/check", page.draft())
        page.post("/mesh", {"file": "meshes/base.wrl", "files": page.draft()["files"]})
        both = workers()
        assert len(both) == 2
        assert len(list((tmp_path / "store").glob("tmp-*"))) == 2
    assert not any(alive(pid) for pid in both)
    assert not list((tmp_path / "store").glob("tmp*"))


def test_too_large_a_file_is_refused_before_it_is_kept(mesh, tmp_path):
    with defining(mesh, tmp_path, most_file_bytes=1000) as page:
        answer = page.post("/files?name=a.wrl", b"x" * 1001)
        assert (answer.status, answer.code) == (413, "define.file_too_large")
        assert answer.json["text"] == "the file is larger than 0.001 MB"
        assert page.post("/files?name=a.wrl", b"x" * 1000).status == 200
    assert len(list((tmp_path / "store" / "files").iterdir())) == 1
    assert [path.name for path in (tmp_path / "store").iterdir() if path.is_file()] == []


def test_an_abandoned_request_is_not_run(tmp_path):
    kept = store.open_store(tmp_path / "store")

    async def main():
        worker = ConfinedWorker(kept.folder, longest_s=5.0, memory_bytes=LIMITS.memory_bytes)

        async def client_is_gone():
            return False

        with pytest.raises(RefusedRequest, match="has disconnected"):
            await worker.run("check", kept.folder, {}, wanted=client_is_gone)
        assert worker.pid is None
        await worker.close()

    run(main())


BOX = b"#VRML V2.0 utf8\nShape { geometry Box { } }\n"


def comb(teeth):
    """Return a face with many corners, slow to triangulate."""
    corners = [(0, 0)]
    for y in range(0, 4 * teeth, 4):
        corners += [(1, y), (100, y + 0.5), (100, y + 1.5), (1, y + 2)]
    points = ", ".join(f"{x} {y} 0" for x, y in [*corners, (0, 4 * teeth)])
    return (
        "#VRML V2.0 utf8\nShape { geometry IndexedFaceSet { convex FALSE coord Coordinate { point [ "
        f"{points} ] }} coordIndex [ {' '.join(map(str, range(len(corners) + 1)))} -1 ] }} }}\n"
    ).encode()


async def stopped_workers(workshop, folder):
    """Return the process ids of the main and the brief worker for slow jobs, started and then stopped."""
    started = [workshop.slow.run("mesh", folder, {"file": "box.wrl"}) for _ in range(2)]
    await asyncio.gather(*started)
    main, brief = workshop.slow.pids
    for pid in (main, brief):
        os.kill(pid, signal.SIGSTOP)
    return main, brief


@pytest.mark.slow
async def test_a_small_file_waits_for_no_slow_one(tmp_path):
    kept = store.open_store(tmp_path / "store")
    files = {"comb.wrl": store.put(kept, comb(teeth=100)), "box.wrl": store.put(kept, BOX)}
    folder = store.lay_out(kept, files)
    workshop = Workshop(kept.folder, Limits(slow_s=30.0))
    try:
        first, second = await stopped_workers(workshop, folder)
        os.kill(second, signal.SIGCONT)
        slow = asyncio.create_task(workshop.slow.run("mesh", folder, {"file": "comb.wrl"}))
        await asyncio.sleep(0)
        assert (await workshop.slow.run("mesh", folder, {"file": "box.wrl"}))["glb"]
        assert not slow.done()
        os.kill(first, signal.SIGCONT)
        assert (await slow)["glb"]
    finally:
        await workshop.close()


@pytest.mark.slow
async def test_two_slow_files_hold_up_no_third_asker_and_both_are_read(tmp_path):
    kept = store.open_store(tmp_path / "store")
    files = {"comb.wrl": store.put(kept, comb(teeth=100)), "box.wrl": store.put(kept, BOX)}
    folder = store.lay_out(kept, files)
    workshop = Workshop(kept.folder, Limits(slow_s=60.0, brief_s=5.0))

    def ask(asker, file):
        return asyncio.create_task(workshop.slow.run("mesh", folder, {"file": file}, asker=asker))

    try:
        first, second = await stopped_workers(workshop, folder)
        slow = [ask("one", "comb.wrl"), ask("two", "comb.wrl")]
        more = [ask("two", "comb.wrl") for _ in range(3)]
        assert (await ask("three", "box.wrl"))["glb"]
        assert not alive(second)
        assert not any(each.done() for each in slow)
        os.kill(first, signal.SIGCONT)
        assert all(each["glb"] for each in await asyncio.gather(*slow, *more))
    finally:
        await workshop.close()


def test_askers_take_turns(tmp_path):
    kept = store.open_store(tmp_path / "store")
    order = []

    async def main():
        begin = asyncio.Event()
        workers = Workers(ConfinedWorker(kept.folder, longest_s=5.0, memory_bytes=LIMITS.memory_bytes))

        async def ask(asker):
            async def wanted():
                order.append(asker)
                await begin.wait()
                return False

            with pytest.raises(RefusedRequest, match="has disconnected"):
                await workers.run("mesh", kept.folder, {}, asker=asker, wanted=wanted)

        asked = [asyncio.create_task(ask(asker)) for asker in ("flood", "flood", "flood", "flood", "other")]
        gone = asyncio.create_task(ask("gone"))
        await asyncio.sleep(0)
        gone.cancel()
        begin.set()
        await asyncio.gather(*asked)

    run(main())
    assert order == ["flood", "flood", "other", "flood", "flood"]


def test_the_asker_is_the_account_or_else_the_address():
    account = SimpleNamespace(name="eve")
    who = object.__new__(SignedIn)
    who.account = account
    scope = {"type": "http", "client": ("192.0.2.7", 1)}
    assert routes._asker(Request(scope)) == "192.0.2.7"
    assert routes._asker(Request(scope | {"signed_in": None})) == "192.0.2.7"
    assert routes._asker(Request(scope | {"signed_in": who})) == "account eve"


@pytest.mark.slow
def test_a_cancelled_request_leaves_no_answer_for_the_next(tmp_path):
    kept = store.open_store(tmp_path / "store")
    folder = store.lay_out(kept, {"a.wrl": store.put(kept, POINTS % b"0 0 0")})

    async def main():
        workshop = Workshop(kept.folder, LIMITS)
        try:
            first = asyncio.create_task(workshop.slow.run("mesh", folder, {"file": "a.wrl"}))
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(first, 0.05)
            with pytest.raises(RefusedRequest, match=r"none\.wrl"):
                await workshop.slow.run("mesh", folder, {"file": "none.wrl"})
        finally:
            await workshop.close()

    run(main())


# ------------------------------------------------------------------------------ the store


def test_the_oldest_files_go_when_there_are_too_many(tmp_path):
    kept = store.open_store(tmp_path / "store", most_bytes=2500)
    first, second = (store.put(kept, letter * 1000) for letter in (b"a", b"b"))
    os.utime(kept.files / first, (1, 1))
    os.utime(kept.files / second, (2, 2))
    assert store.stored(kept, first) is not None  # used again, so the second is now the oldest
    third = store.put(kept, b"c" * 1000)
    assert [store.stored(kept, sha) is not None for sha in (first, second, third)] == [True, False, True]


def test_drafts_do_not_keep_evicted_files(tmp_path):
    kept = store.open_store(tmp_path / "store", most_bytes=2500)
    drafts = [store.lay_out(kept, {"a": store.put(kept, bytes([number]) * 400)}) for number in range(6)]
    for number, folder in enumerate(drafts):
        os.utime(folder, (number, number))
    store.put(kept, b"x" * 2000)
    assert [folder.is_dir() for folder in drafts] == [False, False, True, True, True, True]


def test_the_store_is_its_owners_alone_and_never_anothers(tmp_path):
    folder = tmp_path / "store"
    assert store.open_store(folder).folder == folder
    assert folder.stat().st_mode & 0o777 == 0o700
    (tmp_path / "link").symlink_to(folder)
    other = store.open_store(tmp_path / "link").folder
    assert other != tmp_path / "link"
    (other / "files").rmdir()
    (other / "drafts").rmdir()
    other.rmdir()


def test_drafts_of_the_same_files_share_a_folder_and_the_oldest_go(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "MOST_DRAFTS", 2)
    kept = store.open_store(tmp_path / "store")
    shas = [store.put(kept, letter) for letter in (b"a", b"b", b"c")]
    one = store.lay_out(kept, {"x": shas[0]})
    assert store.lay_out(kept, {"x": shas[0]}) == one
    os.utime(one, (1, 1))
    two, three = (store.lay_out(kept, {"x": sha}) for sha in shas[1:])
    assert [folder.is_dir() for folder in (one, two, three)] == [False, True, True]
    assert (three / "x").read_bytes() == b"c"


def test_a_draft_that_goes_is_never_seen_half_removed(tmp_path, monkeypatch):
    kept = store.open_store(tmp_path / "store")
    files = {f"{number}": store.put(kept, b"x") for number in range(3)}
    folder = store.lay_out(kept, files)
    removed = []
    remove = shutil.rmtree

    def noted(path, **options):
        removed.append(path)
        remove(path, **options)

    monkeypatch.setattr(store.shutil, "rmtree", noted)
    monkeypatch.setattr(store, "MOST_DRAFTS", 1)
    os.utime(folder, (1, 1))
    other = store.lay_out(kept, {"other": files["0"]})
    assert removed
    assert folder not in removed, "it had another name by then"
    assert [path.name for path in kept.drafts.iterdir()] == [other.name]
    assert not list(kept.folder.glob("tmp*"))


def test_the_console_reads_no_urdf_itself_to_list_a_robot(mesh, tmp_path):
    with defining(mesh, tmp_path) as page:
        robot = tmp_path / "robots" / "outside"
        robot.mkdir(parents=True)
        (tmp_path / "arm.urdf").write_text(to_urdf(load("puma560"), shape_uri=lambda link: f"{link}.stl"))
        (robot / "robot.toml").write_text('name = "outside"\nurdf = "../arm.urdf"\n')

        def joints():
            return {row["name"]: row["joints"] for row in page.get("/robots").json["robots"]}["outside"]

        assert joints() == 0, "it is outside of the robot's folder"
        (tmp_path / "arm.urdf").rename(robot / "arm.urdf")
        (robot / "robot.toml").write_text('name = "outside"\nurdf = "arm.urdf"\n')
        assert joints() == 6
        (once,) = workers()
        assert joints() == 6
        assert workers() == [once]
