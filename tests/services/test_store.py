"""The store over a real router: live lists, rights, quotas, runs, and the command line."""

import asyncio
import io
import json
from contextlib import asynccontextmanager

import pytest

from robomesh import reason_codes as codes
from robomesh.contract.quotas import Quotas
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.health import Served, present
from robomesh.wire.session import open_session
from services.command_line.main import run as robomesh
from services.store.history import sha256
from services.store.service import FolderInUseError, Settings, serve
from tests.refusals import refused
from tests.services.test_stored_programs import run_of

Version, Request = schema.ProgramVersion, schema.ProgramRequest


@asynccontextmanager
async def stored(mesh, folder, *, site="s", **values):
    """Run a store; yield a page's session."""
    settings = Settings(site=site, robots=("arm",), folder=folder, **values)
    served = Served(service="store", present_for=((site, "-"),))
    async with open_session(mesh) as own, present(own, served), open_session(mesh) as page:
        task = asyncio.create_task(serve(own, settings))
        try:
            async with asyncio.timeout(30.0):
                while await page.last(f"robomesh/{site}/arm/programs") is None:
                    assert not task.done(), task.exception()
            yield page
        finally:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)


async def ask(session, author, action, **values):
    key = f"robomesh/s/-/programs/request/{author}"
    return await session.ask(key, Request(action=action, robot="arm", **values), timeout_s=20.0)


async def read(session, **values):
    return await session.ask(
        "robomesh/s/-/programs/read", schema.ProgramQuery(robot="arm", **values), timeout_s=20.0
    )


async def test_a_saved_program_is_seen_at_once_with_its_author(mesh, tmp_path):
    async with stored(mesh, tmp_path) as page:
        lists = page.subscribe("robomesh/s/arm/programs", newest=100)
        events = page.subscribe("robomesh/s/arm/events/store", newest=100, history=False)
        assert not (await anext(lists)).message().programs
        answer = await ask(page, "li.s", Request.SAVE, name="pick", text="home\n")
        (program,) = (await anext(lists)).message().programs
        assert program == answer.program
        assert program.current.author == "li.s"
        event = (await anext(events)).message()
        assert (event.code, event.values["id"]) == (codes.PROGRAMS_SAVED.name, program.id)
        await ask(page, "wang.s", Request.DELETE, id=program.id, based_on=1, reason="not used")
        event = (await anext(events)).message()
        assert event.reason.values["reason"] == "not used"
        assert (await anext(lists)).message().programs[0].current.change == Version.DELETED


async def test_fifty_saves_of_two_people_at_the_same_time_lose_no_text(mesh, tmp_path):
    async with stored(mesh, tmp_path) as page:
        program = (await ask(page, "li.s", Request.SAVE, name="pick", text="home\n")).program

        async def work(author):
            based_on = 1
            for number in range(25):
                values = {"id": program.id, "based_on": based_on, "text": f"{author} {number}\n"}
                answer = await ask(page, author, Request.SAVE, **values)
                based_on = answer.program.current.number

        await asyncio.gather(work("li.s"), work("wang.s"))
        content = await read(page, id=program.id)
        hashes = {each.sha256 for each in content.versions}
        assert hashes >= {sha256(f"{author} {n}\n") for author in ("li.s", "wang.s") for n in range(25)}
        assert {each.change for each in content.versions} <= {Version.SAVED, Version.ASIDE}


async def test_saves_have_a_quota_for_each_author(mesh, tmp_path):
    async with stored(mesh, tmp_path, quotas=Quotas(program_saves_a_minute=2)) as page:
        for name in "ab":
            await ask(page, "li.s", Request.SAVE, name=name)
        with refused(codes.OVER_QUOTA, asker="li.s", quota="program_saves_a_minute"):
            await ask(page, "li.s", Request.SAVE, name="c")
        await ask(page, "wang.s", Request.SAVE, name="c")


async def test_the_text_that_a_gateway_runs_is_kept_and_a_replay_s_is_not(mesh, tmp_path):
    async with stored(mesh, tmp_path) as page:
        for robot in ("arm", "replay-1"):
            page.declare_publisher("s", robot, "program/source").put(run_of("wait 1\n", 5))
        async with asyncio.timeout(30.0):
            while not (tmp_path / "s" / "arm" / "runs.json").exists():
                await asyncio.sleep(0.02)
        content = await read(page, sha256=sha256("wait 1\n"))
        assert (content.text, content.version.change) == ("wait 1\n", Version.RUN)
        assert not (tmp_path / "s" / "replay-1").exists()


async def test_a_robot_that_is_started_later_has_a_list(mesh, tmp_path):
    async with stored(mesh, tmp_path) as page:
        page.declare_presence("s", "leg", "gateway")
        async with asyncio.timeout(30.0):
            while await page.last("robomesh/s/leg/programs") is None:
                pass


async def test_a_second_store_of_one_folder_ends_with_a_sentence(mesh, tmp_path, monkeypatch):
    monkeypatch.setattr("services.store.service._LOCK_WITHIN_S", 0.3)

    async with stored(mesh, tmp_path) as page:
        with pytest.raises(FolderInUseError, match="another store uses this folder"):
            await serve(page, Settings(site="s", folder=tmp_path))


async def test_commands_save_show_compare_restore_export_and_import(
    mesh, router, tmp_path, capsys, monkeypatch
):
    (tmp_path / "pick.prog").write_text("home\nwait 1\n")
    (tmp_path / "changed.txt").write_text("home\nwait 2")
    arm = "s/arm"

    def command(*words, status=0, text=""):
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        assert robomesh(["programs", *words, "--connect", router]) == status, words
        return capsys.readouterr().out

    def commands():
        assert "no stored programs" in command("list")
        assert (
            command("import", arm, str(tmp_path / "pick.prog"), "--operator", "li")
            == "pick: version 1, saved\n"
        )
        command("save", arm, str(tmp_path / "changed.txt"), "--name", "pick")
        assert command("show", arm, "pick", "--version", "1") == "home\nwait 1\n"
        diff = command("diff", arm, "pick", status=1)
        assert diff.endswith("@@ -1,2 +1,2 @@\n home\n-wait 1\n+wait 2\n\\ No newline at end of file\n")
        assert command("diff", arm, "pick", "2", "2") == ""
        aside = command("save", arm, "-", "--name", "pick", "--based-on", "1", status=1, text="home\n")
        assert "version 3, put aside" in aside
        command("restore", arm, "pick", "1")
        command("rename", arm, "pick", "place")
        command("delete", arm, "place", "--reason", "not used")
        assert "no stored programs" in command("list", arm)
        assert "deleted: not used" in command("list", arm, "--deleted")
        command("restore", arm, "place", "2")
        (row,) = json.loads(command("list", arm, "--json"))["programs"]
        assert (row["name"], row["current"]["number"]) == ("place", 7)
        assert command("show", arm, sha256("home\n")) == "home\n"
        assert command("show", arm, "place", "--versions").count("version") == 7
        command("export", arm, str(tmp_path / "out"))
        assert (tmp_path / "out" / "place.prog").read_bytes() == b"home\nwait 2"
        command("export", arm, str(tmp_path / "out"), status=2)

    async with stored(mesh, tmp_path / "programs"):
        await asyncio.to_thread(commands)
