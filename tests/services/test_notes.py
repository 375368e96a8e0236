"""Notes on a robot's time: rules, the file, rights, restarts, recordings, and the command line."""

import asyncio
import json
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta

import mcap.reader
import pytest
from mcap_protobuf.decoder import DecoderFactory

from robomesh import reason_codes as codes
from robomesh.client.mesh import AsyncMesh
from robomesh.client.robot.robot import AsyncRobot
from robomesh.contract.quotas import Quotas
from robomesh.errors import NoAnswerError
from robomesh.schemas import robomesh_pb2 as schema
from services.command_line.main import run as robomesh
from services.console.accounts.file import Account, AccountRole
from services.console.accounts.rights import check_right, parse_request
from services.console.accounts.sessions import SignedIn
from services.store import notes as notes_module
from services.store.notes import LONGEST_TEXT, NoteBook
from tests.refusals import refused
from tests.services.recording import recording_site, trace_off, trace_on
from tests.services.test_store import stored

Request = schema.NoteRequest
S = 10**9
EVENTS, RECORDING = "robomesh/site/arm/events/store", "robomesh/site/arm/recording"
AT = 1_800_000_000 * S


def opened(folder, most_bytes=1 << 20):
    book = NoteBook(folder, most_bytes=most_bytes)
    return book, book.open("arm")


def asked(text="weld looks porous", *, begin_ns=None, end_ns=None, **values):
    request = Request(action=Request.WRITE, robot="arm", text=text, **values)
    if begin_ns is not None:
        request.begin.FromNanoseconds(begin_ns)
    if end_ns is not None:
        request.end.FromNanoseconds(end_ns)
    return request


def written(book, text="weld looks porous", author="li", at_ns=AT, **values):
    return book.write(asked(text, **values), author, at_ns)[0].note


def withdrawn(book, note, by, **values):
    return book.withdraw(Request(robot="arm", id=note.id), by, AT + S, **values)[0]


def read(book, since_ns=None, until_ns=None, most=0):
    query = schema.NoteQuery(robot="arm", most=most)
    if since_ns is not None:
        query.since.FromNanoseconds(since_ns)
    if until_ns is not None:
        query.until.FromNanoseconds(until_ns)
    return [(each.code, each.note.text) for each in book.read(query).events]


# ------------------------------------------------------------------------ rules


def test_a_note_is_on_a_moment_or_a_range_and_a_restart_keeps_it(tmp_path):
    book, _ = opened(tmp_path)
    moment = written(book, "now")
    part = written(book, "gripper slips", begin_ns=AT - 60 * S, end_ns=AT - 50 * S, at_ns=AT + S)
    assert moment.begin.ToNanoseconds() == AT
    assert not moment.HasField("end")
    assert (part.begin.ToNanoseconds(), part.end.ToNanoseconds()) == (AT - 60 * S, AT - 50 * S)
    again, damaged = opened(tmp_path)
    assert damaged is None
    assert again.newest("arm", 100) == book.newest("arm", 100)
    assert again.bytes == book.bytes == (tmp_path / "arm/notes.jsonl").stat().st_size


def test_a_query_finds_ranges_that_reach_into_it(tmp_path):
    book, _ = opened(tmp_path)
    written(book, "a", begin_ns=AT - 100 * S, end_ns=AT - 50 * S)
    written(book, "b", begin_ns=AT - 40 * S)
    written(book, "c")
    assert read(book, AT - 60 * S, AT - 30 * S) == [("note.written", "a"), ("note.written", "b")]
    assert read(book, until_ns=AT - 50 * S) == [("note.written", "a")]
    assert read(book, most=1) == [("note.written", "c")]


def test_a_note_is_withdrawn_by_its_author_or_an_administrator_and_stays_in_the_record(tmp_path):
    book, _ = opened(tmp_path)
    note, other = written(book), written(book, "second")
    with refused(codes.NOTES_AUTHOR, author="li"):
        withdrawn(book, note, "wang")
    event = withdrawn(book, note, "li")
    assert (event.code, event.note, event.values["by"]) == ("note.withdrawn", note, "li")
    assert withdrawn(book, other, "wang", administrator=True).values["by"] == "wang"
    assert withdrawn(book, note, "li") == event  # repeated: no second one
    assert [code for code, _ in read(opened(tmp_path)[0])] == [*["note.written"] * 2, *["note.withdrawn"] * 2]


def test_a_repeated_request_adds_no_note(tmp_path):
    book, _ = opened(tmp_path)
    first, is_new = book.write(asked(id="12345678"), "li", AT)
    assert is_new
    assert book.write(asked(id="12345678"), "li", AT + S) == (first, False)
    with refused(codes.NOTES_ID_TAKEN, id="12345678"):
        book.write(asked("other", id="12345678"), "li", AT)


@pytest.mark.parametrize(
    ("values", "code"),
    [
        ({"text": " \n "}, codes.NOTES_TEXT),
        ({"text": "x" * (LONGEST_TEXT + 1)}, codes.NOTES_TEXT),
        ({"text": "\u202e" * LONGEST_TEXT}, codes.NOTES_TEXT),
        ({"id": "../arm2"}, codes.NOTES_ID),
        ({"begin_ns": AT, "end_ns": AT - 1}, codes.NOTES_RANGE),
        ({"begin_ns": AT + 60 * S}, codes.NOTES_FUTURE),
    ],
)
def test_what_is_no_note_is_refused_and_nothing_is_written(tmp_path, values, code):
    book, _ = opened(tmp_path)
    with refused(code):
        book.write(asked(**values), "li", AT)
    assert not (tmp_path / "arm").exists()


def test_a_text_is_one_line_without_hidden_directions(tmp_path):
    book, _ = opened(tmp_path)
    assert written(book, " a\nb\x1b[2J \u202etxt ").text == "a b [2J <U+202E>txt"


def test_a_full_quota_and_a_full_disk_refuse_and_keep_what_is_there(tmp_path, monkeypatch):
    book, _ = opened(tmp_path, most_bytes=1000)
    note = written(book)
    with refused(codes.NOTES_FULL):
        written(book, "x" * 500)
    before = (tmp_path / "arm/notes.jsonl").read_bytes()
    monkeypatch.setattr(notes_module.os, "write", lambda file, data: len(data) // 2)
    with refused(codes.PROGRAMS_DISK):
        withdrawn(book, note, "li")
    monkeypatch.undo()
    assert (tmp_path / "arm/notes.jsonl").read_bytes() == before
    assert withdrawn(book, note, "li").code == "note.withdrawn"  # also with a full quota


def test_a_kill_in_the_middle_of_a_line_loses_only_that_line(tmp_path):
    book, _ = opened(tmp_path)
    written(book, "first")
    path = tmp_path / "arm/notes.jsonl"
    with path.open("ab") as file:
        file.write(b'{"code": "note.wri')
    book, damaged = opened(tmp_path)
    assert damaged is None
    written(book, "second")
    assert [text for _, text in read(opened(tmp_path)[0])] == ["first", "second"]


@pytest.mark.parametrize("line", [b"{}", b"[" * 9000, b"\xff", b'{"code": 1}', b'{"note": {"begin": "x"}}'])
def test_a_damaged_line_is_reported_and_kept(tmp_path, line):
    book, _ = opened(tmp_path)
    written(book, "first")
    path = tmp_path / "arm/notes.jsonl"
    path.write_bytes(line + b"\n" + path.read_bytes())
    book, damaged = opened(tmp_path)
    assert damaged.values["count"] == "1"
    assert [text for _, text in read(book)] == ["first"]
    assert path.read_bytes().startswith(line)


def signed_in(role):
    account = Account(name="li", role=role, hash="", created=datetime.now(UTC))
    times = dict.fromkeys(("began_at", "password_at", "touched_at", "seen_at"), 0.0)
    return SignedIn(account=account, address="", agent="", began=datetime.now(UTC), **times)


def test_only_an_administrator_s_page_may_withdraw_the_notes_of_others():
    key, row = parse_request("robomesh/s/-/notes/withdraw/li.s")
    with refused(codes.ACCOUNT_NOT_ADMIN, account="li"):
        check_right(row, key, signed_in(AccountRole.OPERATOR), "s")
    check_right(row, key, signed_in(AccountRole.ADMIN), "s")
    with refused(codes.NEEDS_OPERATOR, account="li"):
        key, row = parse_request("robomesh/s/-/notes/request/li.s")
        check_right(row, key, signed_in(AccountRole.MONITOR), "s")


# ------------------------------------------------------------------ over a mesh


@asynccontextmanager
async def attached(mesh, site="s"):
    """Yield the robot of a Python program."""
    async with AsyncMesh(mesh.connect[0]) as client:
        yield AsyncRobot(client.session, site, "arm")


async def test_a_note_is_published_listed_and_kept_over_a_restart(mesh, tmp_path):
    async with stored(mesh, tmp_path) as page, attached(mesh) as robot:
        events = page.subscribe("robomesh/s/arm/events/store", newest=10, history=False)
        begin = datetime.now(UTC) - timedelta(seconds=30)
        note = await robot.note("gripper slips", begin, begin + timedelta(seconds=5), author="li")
        event = (await anext(events)).message()
        assert (event.note.id, event.note.author, event.note.text) == (note.id, "li", "gripper slips")
        with refused(codes.NOTES_AUTHOR):
            await robot.withdraw_note(note.id, author="wang")
        await robot.withdraw_note(note.id, author="li")
        assert (await anext(events)).message().values["by"] == "li"
    async with stored(mesh, tmp_path) as page, attached(mesh) as robot:
        (kept,) = await robot.notes()
        assert (kept.id, kept.begin, kept.withdrawn_by) == (note.id, note.begin, "li")
        history = await page.last("robomesh/s/arm/events/store")
        assert [each.code for each in history.events] == ["note.written", "note.withdrawn"]


async def test_notes_have_a_quota_and_known_robots_only(mesh, tmp_path):
    async with stored(mesh, tmp_path, quotas=Quotas(notes_a_minute=2)) as page:
        for robot, code in (("arm", None), ("other", codes.PROGRAMS_ROBOT), ("arm", codes.OVER_QUOTA)):
            request = Request(action=Request.WRITE, robot=robot, text="x")
            sent = page.ask("robomesh/s/-/notes/request/li", request, timeout_s=20.0)
            if code is None:
                await sent
            else:
                with refused(code):
                    await sent


async def test_another_reader_finds_the_note_in_a_running_recording(mesh, tmp_path):
    folder = tmp_path / "store"
    async with recording_site(mesh, tmp_path) as page, stored(mesh, folder, site="site"):
        await trace_on(page)
        async with attached(mesh, "site") as robot:
            note = await robot.note("gripper slips", author="li")
        while EVENTS not in {each.topic for each in (await page.last(RECORDING)).topics}:
            await asyncio.sleep(0.05)
        await trace_off(page)
    (path,) = tmp_path.rglob("*.mcap")
    with path.open("rb") as stream:
        reader = mcap.reader.make_reader(stream, decoder_factories=[DecoderFactory()])
        ((found_in, channel, message, event),) = reader.iter_decoded_messages(topics=[EVENTS])
    assert (found_in.name, channel.message_encoding) == ("robomesh.Event", "protobuf")
    assert (event.note.id, event.note.author, event.note.text) == (note.id, "li", "gripper slips")
    begin_ns = event.note.begin.seconds * S + event.note.begin.nanos
    assert 0 <= message.log_time - begin_ns < 30 * S


async def test_without_a_store_a_note_is_refused_at_once(mesh):
    async with attached(mesh) as robot:
        with pytest.raises(NoAnswerError, match="notes/request"):
            await robot.note("x")


async def test_the_command_writes_lists_and_withdraws_notes(mesh, tmp_path, capsys):
    async with stored(mesh, tmp_path):
        connect = ["--connect", mesh.connect[0]]

        async def command(*words):
            status = await asyncio.to_thread(robomesh, ["note", "s/arm", *words, *connect])
            return status, capsys.readouterr()

        status, out = await command("gripper slips", "--from", "2m", "--to", "1m", "--json")
        note = json.loads(out.out)
        assert (status, note["text"], note["end"] - note["begin"]) == (0, "gripper slips", 60.0)
        assert (await command("x", "--to", "1m"))[0] == 2
        assert (await command("x", "--from", "noon"))[0] == 2
        status, out = await command("--withdraw", note["id"])
        assert status == 0
        status, out = await command()
        assert f"{note['id']}  " in out.out
        assert "(withdrawn by " in out.out
