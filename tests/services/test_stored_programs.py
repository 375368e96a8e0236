"""Programs of a site and their files: versions, conflicts, limits, a kill and a full disk."""

import errno
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from robomesh import reason_codes as codes
from robomesh.files import atomic_write
from robomesh.schemas import robomesh_pb2 as schema
from robots.programs import MOST_BYTES
from services.store import history
from services.store import programs as programs_module
from services.store.programs import ProgramStore
from tests.refusals import refused

Version, Request = schema.ProgramVersion, schema.ProgramRequest
MIB = 1 << 20


def opened(folder, *, most_bytes=MIB, most_run_bytes=MIB, robots=("arm",)):
    folder.mkdir(exist_ok=True)
    store = ProgramStore(folder, most_bytes=most_bytes, most_run_bytes=most_run_bytes)
    problems = list(store.open())
    for robot in robots:
        store.add_robot(robot)
    return store, problems


class Author:
    """A person who changes programs of a store."""

    def __init__(self, store, name="li"):
        self.store, self.name, self.at = store, name, 0

    def ask(self, action, **values):
        self.at += 10**9
        return self.store.change(Request(action=action, robot="arm", **values), self.name, self.at).answer

    def save(self, text, program=None, *, name="pick", based_on=None):
        if program is None:
            return self.ask(Request.SAVE, name=name, text=text)
        based_on = program.current.number if based_on is None else based_on
        return self.ask(Request.SAVE, id=program.id, text=text, based_on=based_on)


def text_of(store, program, version=0):
    return store.read(schema.ProgramQuery(robot="arm", id=program.id, version=version)).text


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "site"


def test_every_change_is_a_version_that_a_restart_keeps(folder):
    store, _ = opened(folder)
    li = Author(store)
    program = li.save("home\n").program
    program = li.save("home\nwait 1\n", program).program
    program = li.ask(Request.RENAME, id=program.id, name="place", based_on=2).program
    program = li.ask(Request.RESTORE, id=program.id, version=1, based_on=3).program
    program = li.ask(Request.DELETE, id=program.id, reason="not used", based_on=4).program
    content = opened(folder)[0].read(schema.ProgramQuery(robot="arm", id=program.id, version=2))
    assert content.text == "home\nwait 1\n"
    assert [(each.number, each.change, each.name) for each in content.versions] == [
        (1, Version.SAVED, "pick"),
        (2, Version.SAVED, "pick"),
        (3, Version.RENAMED, "place"),
        (4, Version.RESTORED, "place"),
        (5, Version.DELETED, "place"),
    ]
    assert content.program == program
    assert content.versions[4].reason == "not used"
    assert content.versions[3].sha256 == content.versions[0].sha256


def test_of_two_saves_on_one_version_both_are_kept(folder):
    store, _ = opened(folder)
    li, wang = Author(store), Author(store, "wang")
    program = li.save("home\n").program
    first = li.save("by li\n", program)
    second = wang.save("by wang\n", program)
    assert (first.version.change, second.version.change) == (Version.SAVED, Version.ASIDE)
    assert second.program.current.author == "li"
    assert [text_of(store, program, n) for n in (0, 2, 3)] == ["by li\n", "by li\n", "by wang\n"]
    # The author looks at the difference, and decides for the own text.
    taken = wang.ask(Request.RESTORE, id=program.id, version=3, based_on=2)
    assert (taken.version.number, text_of(store, program)) == (4, "by wang\n")


def test_a_repeated_save_adds_no_version(folder):
    store, _ = opened(folder)
    li, wang = Author(store), Author(store, "wang")
    program = li.save("home\n").program
    li.save("by li\n", program)
    assert li.save("by li\n", program).version.number == 2
    wang.save("by wang\n", program)
    assert wang.save("by wang\n", program).version.number == 3
    assert store.programs("arm").programs[0].versions == 3


def test_a_rename_deletion_or_restoration_names_the_current_version(folder):
    store, _ = opened(folder)
    li = Author(store)
    program = li.save("home\n").program
    li.save("wait 1\n", program)
    for action, values in (
        (Request.RENAME, {"name": "other"}),
        (Request.DELETE, {"reason": "old"}),
        (Request.RESTORE, {"version": 1}),
    ):
        with refused(codes.PROGRAMS_CHANGED, version="2", author="li"):
            li.ask(action, id=program.id, based_on=1, **values)


def test_a_save_of_a_deleted_program_is_kept_and_can_be_restored(folder):
    store, _ = opened(folder)
    li, wang = Author(store), Author(store, "wang")
    program = li.save("home\n").program
    li.ask(Request.DELETE, id=program.id, reason="old", based_on=1)
    saved = wang.save("wait 1\n", program)
    assert saved.version.change == Version.ASIDE
    restored = wang.ask(Request.RESTORE, id=program.id, version=3, based_on=2)
    assert restored.program.current.change == Version.RESTORED
    assert text_of(store, program) == "wait 1\n"


def test_a_name_is_used_once_until_its_program_is_deleted(folder):
    store, _ = opened(folder)
    li = Author(store)
    program = li.save("home\n", name="Größe").program
    for same in ("Größe", "größe", "GRÖSSE", "Gro\u0308ße"):
        with refused(codes.PROGRAMS_NAME_TAKEN, name="Größe"):
            li.save("other\n", name=same)
    li.ask(Request.DELETE, id=program.id, reason="old", based_on=1)
    li.save("other\n", name="größe")
    with refused(codes.PROGRAMS_NAME_TAKEN):
        li.ask(Request.RESTORE, id=program.id, version=1, based_on=2)
    assert li.ask(Request.RESTORE, id=program.id, version=1, based_on=2, name="alt").version.name == "alt"


@pytest.mark.parametrize(
    "name", ["", " ", "a/b", "a\\b", ".a", "a.", "a\nb", "a" * 61, "a\u202eb", 'a"b', "..", "con:x"]
)
def test_a_name_that_no_file_can_have_is_refused(folder, name):
    li = Author(opened(folder)[0])
    with refused(codes.PROGRAMS_NAME, most="60"):
        li.save("home\n", name=name)


def test_invalid_requests_say_what_is_wrong(folder):
    store, _ = opened(folder)
    li = Author(store)
    program = li.save("home\n").program
    with refused(codes.PROGRAM_TOO_LONG, kib="64"):
        li.save("#" * (MOST_BYTES + 1), program)
    with refused(codes.PROGRAMS_NOT_TEXT):
        li.save("a\0b", program)
    with refused(codes.PROGRAMS_REASON):
        li.ask(Request.DELETE, id=program.id, reason=" ", based_on=1)
    with refused(codes.PROGRAMS_VERSION, version="7", newest="1"):
        li.ask(Request.RESTORE, id=program.id, version=7, based_on=1)
    with refused(codes.PROGRAMS_UNKNOWN, id="none"):
        li.ask(Request.RENAME, id="none", name="x")
    with refused(codes.PROGRAMS_ROBOT, robot="leg"):
        store.change(Request(action=Request.SAVE, robot="leg", name="a"), "li", 1)
    with refused(codes.PROGRAMS_TEXT):
        store.read(schema.ProgramQuery(robot="arm", sha256="0" * 64))


def test_a_full_quota_refuses_new_versions_and_still_deletes(folder):
    store, _ = opened(folder, most_bytes=3000)
    li = Author(store)
    program = li.save("a" * 1200).program
    li.save("b" * 700, name="other")
    with refused(codes.PROGRAMS_FULL):
        li.save("c" * 700, program)
    assert text_of(store, program) == "a" * 1200
    li.ask(Request.DELETE, id=program.id, reason="space", based_on=1)


def test_numbers_of_programs_and_versions_are_bounded(folder, monkeypatch):
    monkeypatch.setattr(programs_module, "MOST_PROGRAMS", 2)
    monkeypatch.setattr(history, "MOST_VERSIONS", 3)
    li = Author(opened(folder)[0])
    program = li.save("1", name="a").program
    li.save("1", name="b")
    with refused(codes.PROGRAMS_TOO_MANY, most="2"):
        li.save("1", name="c")
    for text in "23":
        program = li.save(text, program).program
    with refused(codes.PROGRAMS_VERSIONS, most="3"):
        li.save("4", program)


# ------------------------------------------------------------------------ runs


def run_of(text, at_s, name="draft"):
    source = schema.ProgramSource(name=name, operator="li", text=text)
    source.timestamp.FromSeconds(at_s)
    return source


def by_hash(store, text):
    return store.read(schema.ProgramQuery(robot="arm", sha256=history.sha256(text)))


def test_a_text_that_ran_is_found_by_its_hash_saved_or_not(folder):
    store, _ = opened(folder)
    program = Author(store).save("home\n").program
    store.keep_run("arm", run_of("home\n", 5))
    store.keep_run("arm", run_of("wait 1\n", 6))
    again, problems = opened(folder)
    assert not problems
    assert by_hash(again, "home\n").program == program
    found = by_hash(again, "wait 1\n")
    assert (found.text, found.version.change, found.version.name) == ("wait 1\n", Version.RUN, "draft")
    assert not found.HasField("program")


def test_the_oldest_runs_make_room_and_their_texts_go(folder, monkeypatch):
    monkeypatch.setattr(programs_module, "MOST_RUNS", 3)
    store, _ = opened(folder, robots=("arm", "leg"))
    for at, text in enumerate("abcd"):
        store.keep_run("arm", run_of(text, at))
    store.keep_run("arm", run_of("b", 9))  # runs again: now the newest
    store.keep_run("arm", run_of("e", 10))
    with refused(codes.PROGRAMS_TEXT):
        by_hash(store, "c")
    assert [by_hash(store, text).text for text in "dbe"] == [*"dbe"]
    small, _ = opened(folder, most_run_bytes=1100, robots=("arm", "leg"))
    small.keep_run("leg", run_of("f", 11))
    texts = sorted(path.read_text() for path in folder.glob("*/texts/*"))
    assert texts == ["e", "f"]


def test_a_saved_text_stays_when_its_run_makes_room(folder, monkeypatch):
    monkeypatch.setattr(programs_module, "MOST_RUNS", 1)
    store, _ = opened(folder)
    store.keep_run("arm", run_of("home\n", 1))
    program = Author(store).save("home\n").program
    store.keep_run("arm", run_of("wait 1\n", 2))
    assert text_of(opened(folder)[0], program) == "home\n"


# ------------------------------------------------------------------------ disk


def test_a_damaged_file_is_set_aside_and_the_others_are_read(folder):
    store, _ = opened(folder)
    li = Author(store)
    damaged, kept = li.save("home\n").program, li.save("wait 1\n", name="other").program
    path = folder / "arm" / f"{damaged.id}.json"
    path.write_bytes(path.read_bytes()[:-20])
    store, problems = opened(folder)
    assert [each.code for each in problems] == [codes.PROGRAMS_DAMAGED.name]
    assert [each.id for each in store.programs("arm").programs] == [kept.id]
    # Its texts may be needed once the file is mended.
    assert path.with_suffix(".damaged").exists()
    assert len(list((folder / "arm" / "texts").iterdir())) == 2


def test_a_text_that_was_edited_on_the_disk_is_not_shown_as_the_version(folder):
    store, _ = opened(folder)
    program = Author(store).save("home\n").program
    next((folder / "arm" / "texts").iterdir()).write_text("move_joints 1 2 3\n")
    with refused(codes.PROGRAMS_DAMAGED):
        text_of(store, program)


def test_a_disk_that_refuses_changes_nothing_and_is_named(folder, monkeypatch):
    store, _ = opened(folder)
    li = Author(store)
    program = li.save("home\n").program
    fsync, failing = os.fsync, [False, True]

    def full(descriptor):
        if failing and failing.pop(0):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        fsync(descriptor)

    # The text can be written, the version cannot.
    failing[:] = [False, False, True]
    monkeypatch.setattr(atomic_write.os, "fsync", full)
    with refused(codes.PROGRAMS_DISK, detail="No space left on device"):
        li.save("wait 1\n", program)
    assert store.programs("arm").programs == [program]
    assert len(list((folder / "arm" / "texts").iterdir())) == 1
    assert not list((folder / "arm").glob(".*.new"))
    assert li.save("wait 1\n", program).version.number == 2


_SAVE_UNTIL_KILLED = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from tests.services.test_stored_programs import Author, opened
store, _ = opened(Path(sys.argv[1]))
li = Author(store)
program = li.save("0").program
for number in range(1, 900):
    program = li.save(f"{number} " * 2000, program).program
    print(number, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("after", [1, 7, 30])
def test_a_kill_in_the_middle_of_saves_loses_no_confirmed_version(folder, after):
    root = Path(__file__).resolve().parents[2]
    with subprocess.Popen(
        [sys.executable, "-c", _SAVE_UNTIL_KILLED, str(folder), str(root)], stdout=subprocess.PIPE, text=True
    ) as saver:
        confirmed = 0
        while confirmed < after:
            confirmed = int(saver.stdout.readline())
        time.sleep(0.0007 * after)
        saver.send_signal(signal.SIGKILL)
        confirmed = max(confirmed, *(int(line) for line in saver.stdout if line.endswith("\n")), 0)
    store, problems = opened(folder)
    assert not problems
    (program,) = store.programs("arm").programs
    assert program.versions in (confirmed + 1, confirmed + 2)
    for number in range(1, program.versions):
        assert text_of(store, program, number + 1) == f"{number} " * 2000
    assert len(list((folder / "arm" / "texts").iterdir())) == program.versions
    assert not list((folder / "arm").rglob("*.new"))


_SAVE_ON_A_SMALL_DISK = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from tests.services.test_stored_programs import Author, opened
from robomesh.errors import RefusedError
store, _ = opened(Path(sys.argv[1]))
li = Author(store)
program = li.save("home").program
try:
    for number in range(1, 200):
        program = li.save(f"{number} " * 3000, program).program
except RefusedError as error:
    print(error.code, "|", error)
"""


@pytest.mark.slow
def test_a_file_system_without_space_refuses_a_save_and_keeps_the_rest(folder, tmp_path):
    mount = tmp_path / "disk"
    mount.mkdir()
    script = tmp_path / "script.py"
    script.write_text(_SAVE_ON_A_SMALL_DISK)
    root = Path(__file__).resolve().parents[2]
    shell = (
        f"mount -t tmpfs -o size=200k none {mount} && {sys.executable} {script} {mount}/site {root} "
        f"&& cp -r {mount}/site {folder}"
    )
    done = subprocess.run(
        ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", shell], capture_output=True, text=True
    )
    if done.returncode and re.search("mount|unshare", done.stderr):
        pytest.skip(f"no mounts here: {done.stderr.strip()}")
    assert done.stdout.startswith("programs.disk | "), done
    assert "No space left on device" in done.stdout
    store, problems = opened(folder)
    assert not problems
    (program,) = store.programs("arm").programs
    assert program.versions > 2
    assert len(list((folder / "arm" / "texts").iterdir())) == program.versions
    assert not list((folder / "arm").rglob("*.new"))


def test_a_file_size_limit_is_a_clear_refusal(folder):
    store, _ = opened(folder)
    li = Author(store)
    program = li.save("home\n").program
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with refused(codes.PROGRAMS_DISK, detail="File too large"):
            li.save("x" * 5000, program)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)
    assert store.programs("arm").programs == [program]
