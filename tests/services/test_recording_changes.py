"""Names, notes, tags and deletions of recordings: on the mesh, on the disk, after kills, by command."""

import asyncio
import errno
import hashlib
import json
import os
import subprocess
import sys

import pytest
from mcap.reader import make_reader

from robomesh import reason_codes as codes
from robomesh.client.recordings.recorder_file import RecorderFile
from robomesh.recordings import changes as changes_of
from robomesh.recordings.changes import changes_path, read_changes
from robomesh.recordings.reading import RecordingFile
from robomesh.schemas import robomesh_pb2 as schema
from robomesh.service.health import Served, present
from services.command_line.main import run as robomesh
from tests.conftest import run
from tests.recordings import write_recording
from tests.refusals import refused
from tests.services.recording import next_event, recording_site, trace_off, trace_on

Ask, Change = schema.RecordingRequest, schema.RecordingChange
BASE = "robomesh/site/-/recordings"
WITHIN_S = 20.0


@pytest.fixture
def trial(tmp_path):
    """Return a recording in a recorder's folder."""
    (tmp_path / "arm").mkdir()
    path = tmp_path / "arm" / "2026-11-25T10-00-00.000000Z_trial.mcap"
    write_recording(path)
    return path


async def ask(session, action, file, *, by="li", **values):
    return await session.ask(
        f"{BASE}/request/{by}", Ask(action=action, file=file, **values), timeout_s=WITHIN_S
    )


async def listed(session, *, deleted=False):
    query = schema.RecordingListQuery(deleted=deleted)
    answer = await session.ask(f"{BASE}/list", query, timeout_s=WITHIN_S)
    return {each.file: each for each in answer.recordings}


def test_name_note_and_tags_are_kept_beside_an_unchanged_file(mesh, trial, tmp_path):
    before, file = trial.read_bytes(), trial.name

    async def main():
        async with recording_site(mesh, tmp_path) as session:
            events = session.subscribe("robomesh/site/arm/events/recorder", newest=100, history=False)
            first = await ask(session, Ask.RENAME, file, name="  Greifer links  ")
            assert (first.name, first.changes) == ("Greifer links", 1)
            event = await next_event(events, "recording.renamed")
            assert event.values["author"] == "li"
            assert event.values["file"] == file
            assert event.reason.code == "recording.renamed"
            await ask(session, Ask.NOTE, file, based_on=1, note="slipped twice\nsee ticket 12")
            await ask(session, Ask.TAG, file, by="wang", based_on=2, tags=["fault", " Fault ", "cell 2"])
            again = await ask(session, Ask.TAG, file, based_on=2, tags=["fault", "cell 2"])
            assert again.changes == 3  # there is nothing to change, so no conflict either
            with refused(codes.RECORDING_CONFLICT, author="wang"):
                await ask(session, Ask.NOTE, file, based_on=2, note="other")
            row = (await listed(session))[file]
            assert (row.name, row.note) == ("Greifer links", "slipped twice\nsee ticket 12")
            assert list(row.tags) == ["fault", "cell 2"]
            assert not row.history
            info = await session.ask(f"{BASE}/info", schema.RecordingQuery(file=file), timeout_s=WITHIN_S)
            assert [each.change for each in info.history] == [Change.RENAMED, Change.NOTED, Change.TAGGED]

    run(main())
    assert trial.read_bytes() == before
    with trial.open("rb") as stream:  # the mcap library still reads it
        assert make_reader(stream).get_summary().statistics.message_count > 0

    async def restarted():
        async with recording_site(mesh, tmp_path) as session:
            assert (await listed(session))[file].name == "Greifer links"

    run(restarted())


@pytest.mark.parametrize(
    ("action", "values", "code"),
    [
        (Ask.RENAME, {"name": ""}, codes.RECORDING_TITLE),
        (Ask.RENAME, {"name": "../up"}, codes.RECORDING_TITLE),
        (Ask.RENAME, {"name": "x" * 61}, codes.RECORDING_TITLE),
        (Ask.RENAME, {"name": "a\u202eb"}, codes.RECORDING_TITLE),
        (Ask.NOTE, {"note": "x" * 2001}, codes.RECORDING_NOTE),
        (Ask.TAG, {"tags": ["a,b"]}, codes.RECORDING_TAG),
        (Ask.TAG, {"tags": [""]}, codes.RECORDING_TAG),
        (Ask.TAG, {"tags": [str(each) for each in range(21)]}, codes.RECORDING_TAGS),
        (Ask.DELETE, {"reason": "  "}, codes.RECORDING_REASON),
        (Ask.DELETE, {"reason": "old", "based_on": 7}, codes.RECORDING_CONFLICT),
    ],
)
def test_an_invalid_change_is_refused_and_changes_nothing(action, values, code, trial):
    with refused(code):
        asked = Ask(action=action, file=trial.name, **values)
        changes_of.changed(schema.Recording(name="trial"), (), asked, "li", 1)


async def test_a_change_of_no_recording_is_refused(mesh, trial, tmp_path):
    async with recording_site(mesh, tmp_path) as session:
        for file in ("", "gone.mcap", "../arm/x.mcap", "/etc/passwd", "a\0b.mcap", "*.mcap"):
            for action in (Ask.RENAME, Ask.DELETE):
                with refused(codes.RECORDING_UNKNOWN):
                    await ask(session, action, file, name="x", reason="y")
    assert trial.exists()


async def test_a_deletion_names_author_reason_and_hash_and_stays_visible(mesh, trial, tmp_path):
    data = trial.read_bytes()
    hashed = hashlib.sha256(data).hexdigest()
    async with recording_site(mesh, tmp_path) as session:
        events = session.subscribe("robomesh/site/arm/events/recorder", newest=100, history=False)
        await ask(session, Ask.RENAME, trial.name, name="first try")
        await ask(session, Ask.DELETE, trial.name, based_on=1, reason="arm was not clamped")
        event = await next_event(events, "recording.deleted")
        assert event.values["sha256"] == hashed
        assert event.values["bytes"] == str(len(data))
        for word in ("li", "first try", "arm was not clamped", trial.name, hashed):
            assert word in event.text
        repeated = await ask(session, Ask.DELETE, trial.name, based_on=1, reason="arm was not clamped")
        assert repeated.deleted
        with refused(codes.RECORDING_UNKNOWN):
            await ask(session, Ask.DELETE, trial.name, by="wang", reason="me too")
        assert trial.name not in await listed(session)
        gone = (await listed(session, deleted=True))[trial.name]
        assert gone.deleted
        assert (gone.name, gone.robot, gone.bytes) == ("first try", "arm", len(data))
        assert gone.history[-1].reason == "arm was not clamped"
    assert [each.name for each in trial.parent.iterdir()] == [changes_path(trial).name]


async def test_a_deleted_recording_of_the_recorders_own_folder_has_no_robot(mesh, tmp_path):
    path = tmp_path / "2026-11-25T10-00-00.000000Z_trial.mcap"
    write_recording(path)
    async with recording_site(mesh, tmp_path) as session:
        assert (await ask(session, Ask.DELETE, path.name, reason="test")).deleted
        assert (await listed(session, deleted=True))[path.name].robot == ""


async def test_a_recording_in_use_is_not_deleted(mesh, trial, tmp_path):
    async with recording_site(mesh, tmp_path) as session:
        open_now = (await trace_on(session, name="now")).file
        with refused(codes.RECORDING_WRITTEN):
            await ask(session, Ask.DELETE, open_now, reason="x")
        renamed = await ask(session, Ask.RENAME, open_now, name="while it runs")
        assert renamed.open
        assert (await trace_off(session)).name == "while it runs"
        with RecordingFile(trial), refused(codes.RECORDING_PLAYED):  # as a player keeps it open
            await ask(session, Ask.DELETE, trial.name, reason="x")
        file = RecorderFile(session, "site", trial.name, asker="wang")
        first = await file.piece(length=10)
        with refused(codes.RECORDING_FETCHED, who="wang"):
            await ask(session, Ask.DELETE, trial.name, reason="x")
        await file.piece(offset=10, length=first.total)
        await ask(session, Ask.DELETE, trial.name, reason="x")
    assert not trial.exists()


async def test_a_fetched_recording_brings_its_name_note_and_tags(mesh, trial, tmp_path, capsys):
    out = tmp_path / "copy"
    out.mkdir()
    served = Served(service="recorder", present_for=(("site", "-"),))
    async with recording_site(mesh, tmp_path) as session, present(session, served):
        file = RecorderFile(session, "site", trial.name, asker="li")
        await file.change(Ask(action=Ask.RENAME, name="renamed"))
        await file.fetch(out / "mine.mcap")
    assert (out / "mine.mcap").read_bytes() == trial.read_bytes()
    assert robomesh(["recordings", "info", str(out / "mine.mcap"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["name"] == "renamed"


KILLED = """
import os, signal, sys
from pathlib import Path
from services.recorder import changes
from robomesh.schemas import robomesh_pb2 as schema

folder, trial = Path(sys.argv[1]), Path(sys.argv[2])
data = trial.read_bytes()

def delete(steps):
    left = steps
    def counted(real):
        def call(*values, **named):
            nonlocal left
            left -= 1
            if left < 0:
                os.kill(os.getpid(), signal.SIGKILL)
            return real(*values, **named)
        return call
    for name in ("rename", "unlink", "replace"):
        setattr(Path, name, counted(getattr(Path, name)))
    os.fsync = counted(os.fsync)
    now = schema.Recording(name="trial", file=trial.name, robot="arm")
    work._delete(now, schema.RecordingRequest(action=4, file=trial.name, reason="test"), "li")

work = changes.RecordingChanges(
    folder, describe=None, is_used=lambda *_: None, free_reserve=lambda: None, report=None
)
for steps in range(20):
    changes.changes_path(trial).unlink(missing_ok=True)
    trial.write_bytes(data)
    if not (child := os.fork()):
        delete(steps)
        os._exit(0)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    work.recover()
    deleted = [each.reason for each in changes.read_changes(trial)] == ["test"]
    names = sorted(path.name for path in trial.parent.iterdir())
    whole = trial.exists() and trial.read_bytes() == data
    print(status, deleted, whole, *names)
    if status == 0:
        break
"""


@pytest.mark.slow
def test_a_kill_at_any_step_leaves_the_recording_or_its_deletion(trial, tmp_path):
    command = [sys.executable, "-c", KILLED, str(tmp_path), str(trial)]
    lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    kept, gone = f"False True {trial.name}", f"True False {changes_path(trial).name}"
    *killed, ended = [line.split(" ", 1) for line in lines]
    assert ended == ["0", gone]
    assert {status for status, _ in killed} == {"-9"}
    outcomes = [outcome for _, outcome in killed]
    begun = outcomes.index(gone)
    assert outcomes == [kept] * begun + [gone] * (len(outcomes) - begun)
    assert begun > 1


async def test_on_a_full_disk_a_deletion_makes_room_and_a_rename_is_refused(
    mesh, trial, tmp_path, monkeypatch
):
    from services.recorder import changes

    real = changes.write_changes

    def write(path, values):
        # As a disk does, which frees a file's space only when no program has it open.
        data = next((each for each in (trial, trial.with_suffix(".deleting")) if each.exists()), None)
        if data is not None and data.stat().st_size:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        real(path, values)

    monkeypatch.setattr(changes, "write_changes", write)
    async with recording_site(mesh, tmp_path) as session:
        with refused(codes.RECORDING_DISK):
            await ask(session, Ask.RENAME, trial.name, name="x")
        assert trial.exists()
        assert (await ask(session, Ask.DELETE, trial.name, reason="disk full")).deleted
    assert not trial.exists()
    assert read_changes(trial)[-1].reason == "disk full"


async def test_a_damaged_file_of_changes_is_put_aside_with_an_event(mesh, trial, tmp_path):
    async with recording_site(mesh, tmp_path) as session:
        events = session.subscribe("robomesh/site/-/events/recorder", newest=100, history=False)
        for content in ("", "{", '{"changes": 1}', '{"changes": [{"number": 4}]}'):
            changes_path(trial).write_text(content)
            assert (await listed(session))[trial.name].name == trial.stem
            await ask(session, Ask.RENAME, trial.name, name="x")
            await next_event(events, "recording.labels_damaged")
            assert (await listed(session))[trial.name].name == "x"
            assert changes_path(trial).with_suffix(".damaged").read_text() == content


async def test_the_command_line_renames_notes_tags_and_deletes(mesh, trial, tmp_path, capsys):
    def command(*words):
        status = robomesh(["recordings", *words, "--connect", mesh.connect[0]])
        return status, capsys.readouterr()

    served = Served(service="recorder", present_for=(("site", "-"),))
    async with recording_site(mesh, tmp_path) as session, present(session, served):
        await session.ask(f"{BASE}/list", timeout_s=WITHIN_S)
        call = asyncio.to_thread
        assert (await call(command, "rename", trial.name, "second try", "--operator", "li"))[0] == 0
        assert (await call(command, "note", "second try", "ok", "--operator", "li"))[0] == 0
        assert (await call(command, "tag", "second try", "a", "b", "--operator", "li"))[0] == 0
        status, out = await call(command, "tag", "second try", "A", "--remove", "--json")
        assert status == 0, out.err
        assert json.loads(out.out)["tags"] == ["b"]
        _, out = await call(command, "list", "--tag", "B", "--json")
        assert json.loads(out.out)["note"] == "ok"
        assert (await call(command, "list", "--tag", "c"))[1].out == "no recordings\n"
        status, out = await call(command, "delete", "second try", "--reason", "done")
        assert status == 0, out.err
        assert "SHA-256" in out.out
        assert (await call(command, "list"))[1].out == "no recordings\n"
        assert "deleted by" in (await call(command, "list", "--deleted"))[1].out
        assert (await call(command, "delete", "second try", "--reason", "x"))[0] == 2
