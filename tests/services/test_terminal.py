"""Texts of others reach the terminal neither as control sequences nor as additional lines.

Every command that reads the mesh runs on a terminal while a publisher fills every field of every topic and
answer with hostile values.
"""

import json
import logging
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import pytest
import zenoh

from robomesh.contract.endpoints import router_config
from robomesh.service import service
from services.command_line.commands import COMMANDS, load
from services.command_line.service_settings.table import SERVICES
from tests import warm
from tests.hostile import IDENTITY, SEQUENCES, UNKNOWN, Values, publisher
from tests.ports import free_port

# One worker runs this file, so that every command runs once for each kind of publisher.
pytestmark = pytest.mark.processes

AT_ONCE = 3
WITHIN_S = 120.0
WIDE, NARROW = 6000, 80


@dataclass(frozen=True)
class Row:
    """Arguments and properties of one run of a command.

    Attributes:
        words: Its arguments; {folder}: a folder with a program and a cell's content.
        until: It is interrupted when it has printed this; empty: it ends by itself.
        json: It has --json.
        lines: Its output has texts of several lines.
    """

    words: str = "hall/arm"
    until: str = ""
    json: bool = False
    lines: bool = False


CHANGED = "hall/arm p1"
# Command -> its runs. A new command without a row fails.
ROWS: dict[str, tuple[Row, ...]] = {
    "list": (Row("", json=True), Row("--watch", until="hall")),
    "monitor": (Row("hall/arm --count 2", json=True), Row("hall/replay-1 --count 2", json=True)),
    "signals": (Row(json=True),),
    "send": (Row("hall/arm home", json=True), Row("hall/arm stop"), Row("hall/arm trace on")),
    "fault": (Row(json=True), Row("hall/arm freeze")),
    "snapshot": (Row(f"hall/arm {IDENTITY} {{folder}}/a.png"),),
    "video": (Row(f"hall/arm {IDENTITY} {{folder}}/a.mp4 --seconds 0.1"),),
    "record": (Row("hall/arm --name x", json=True), Row("hall/arm --stop")),
    "alive": (Row("hall/gateway"),),
    "version": (Row("--all", json=True),),
    "robot verify": (Row(),),
    "programs list": (Row("", json=True),),
    "programs show": (Row(CHANGED, json=True, lines=True), Row(f"{CHANGED} --versions")),
    "programs save": (Row("hall/arm {folder}/p.prog", json=True),),
    "programs rename": (Row(f"{CHANGED} new", json=True),),
    "programs delete": (Row(f"{CHANGED} --reason x", json=True),),
    "programs restore": (Row(f"{CHANGED} 1", json=True),),
    "programs diff": (Row(CHANGED, lines=True),),
    "programs export": (Row("hall/arm {folder}/exported"),),
    "programs import": (Row("hall/arm {folder}/p.prog", json=True),),
    "note": (Row(json=True), Row("hall/arm text")),
    "cell show": (Row(json=True),),
    "cell set": (Row("hall/arm {folder}/cell.toml --yes", json=True),),
    "cell move": (Row("hall/arm table --xyz 0 0 0 --yes"),),
    "cell undo": (Row("hall/arm --yes", json=True),),
    "recordings list": (Row("--deleted", json=True),),
    "recordings info": (Row("rec", json=True, lines=True),),
    "recordings rename": (Row("rec new", json=True),),
    "recordings note": (Row("rec text", json=True),),
    "recordings tag": (Row("rec a", json=True),),
    "recordings delete": (Row("rec --reason x", json=True),),
    "recordings play": (Row("rec", until="playing"),),
    "recordings export": (Row("rec {folder}/t.csv"),),
    "recordings fetch": (Row("rec {folder}/fetched"),),
    "audit list": (Row("", json=True), Row("hall/arm")),
    "alarms list": (Row("", json=True),),
    "alarms ack": (Row("all", json=True),),
    "alarms shelve": (Row("all --reason x", json=True),),
    "alarms unshelve": (Row("all", json=True),),
}
# Processes of a site, which print their logs only (`test_a_log_record_is_one_line`).
OF_SITES = {*SERVICES, "simulate", "foxglove", "ros2"}
# A publisher's choice of these leads the commands to their other texts.
FIXED = {
    "AlarmList.site": "hall",
    "Description.Joint.name": f"axis{SEQUENCES}",
    "KinematicState.tool_to_base": [1.0] * 16,
    "Piece.total": 1,
    "Recording.deleted": False,
    "Recording.file": "rec.mcap",
    "Recording.name": "rec",
    "Recording.open": False,
    "ServiceHealth.id": IDENTITY,
    "StoredProgram.id": "p1",
    "foxglove.JointState.name": f"axis{SEQUENCES}",
}
TEXTS = Values(texts=SEQUENCES, fixed=FIXED)
KINDS = {
    # Every text is hostile; of a second site also those in FIXED.
    "texts": (TEXTS, replace(TEXTS, fixed={}, listed=2)),
    "enums": (Values(enum=UNKNOWN, fixed=FIXED),),
    "not numbers": (
        Values(number=float("nan"), integer=True, seconds=-62_135_596_800, fixed=FIXED),
        Values(number=float("-inf"), integer=True, seconds=253_402_300_799, listed=0),
    ),
    "refusals": (TEXTS,),
}


class Run(NamedTuple):
    """A run: its row, exit status and output."""

    row: Row
    status: int
    received: bytes


def _run(router: str, folder: Path, command: str, row: Row, columns: int, *more: str) -> Run:
    words = f"{command} {row.words}".format(folder=folder).split()
    arguments = (*words, *more, "--connect", router)
    return Run(row, *warm.on_terminal(arguments, timeout_s=WITHIN_S, columns=columns, until=row.until))


@pytest.fixture(scope="module", params=KINDS)
def ran(request, tmp_path_factory) -> Iterator[tuple[str, dict[str, list[Run]]]]:
    """Run every command while a kind of publisher publishes; yield the kind, and each command's runs."""
    kind, folder = request.param, tmp_path_factory.mktemp("terminal")
    (folder / "p.prog").write_text("HOME\n")
    (folder / "cell.toml").write_text("")
    router = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        stack.enter_context(zenoh.open(router_config((router,))))
        for site, values in zip(("hall", "mill"), KINDS[kind], strict=False):
            stack.enter_context(publisher(router, site, values, refuse=kind == "refusals"))
        pool = stack.enter_context(ThreadPoolExecutor(AT_ONCE))
        runs = {
            command: [
                pool.submit(_run, router, folder, command, row, NARROW if kind == "enums" else WIDE, *more)
                for row in rows
                for more in ((), ("--json",))
                if not more or (row.json and kind in ("texts", "not numbers"))
            ]
            for command, rows in ROWS.items()
        }
        yield kind, {command: [each.result() for each in futures] for command, futures in runs.items()}


def test_every_command_has_a_row_or_reads_no_mesh():
    def leaves(name, command):
        for word, each in getattr(command, "commands", {}).items():
            yield from leaves(f"{name} {word}", each)
        if not hasattr(command, "commands"):
            yield name, command

    attached = {
        name
        for top in COMMANDS
        for name, command in leaves(top, load(top))
        if any(each.name == "connect" for each in command.params)
    }
    assert attached - OF_SITES == set(ROWS)


@pytest.mark.parametrize("command", ["programs export hall/arm", "recordings fetch x"])
@pytest.mark.parametrize("name", ["../x", ".profile", "a\\x"])
def test_a_name_of_a_store_or_recorder_is_no_path(tmp_path, command, name):
    (folder := tmp_path / "out").mkdir()
    router = f"tcp/127.0.0.1:{free_port()}"
    fixed = FIXED | {"ProgramVersion.name": name, "Recording.file": name, "Recording.name": "x"}
    row = Row("{folder}")
    with zenoh.open(router_config((router,))), publisher(router, "hall", Values(fixed=fixed)):
        run = _run(router, folder, command, row, NARROW)
    assert run.status == 2
    assert b"file" in run.received
    assert [*tmp_path.rglob("*")] == [folder]


# The commands' styles: basic colours and weights; cursor, screen and line of a display that is redrawn.
OWN = re.compile(
    rb"\x1b\[(?:(?:[0-9]|3\d|4\d|9\d|38;5;237)(?:;\d\d?)*m|m|\?(?:25|1049)[hl]|H|2K|1?\dA)|\r(?=\x1b\[)"
)
INTERPRETED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]")


@pytest.mark.parametrize("command", ROWS)
def test_no_character_reaches_the_terminal_that_it_interprets(ran, command):
    _, runs = ran
    for run in runs[command]:
        text = OWN.sub(b"", run.received).decode()
        assert (run.row, sorted(set(INTERPRETED.findall(text)))) == (run.row, [])


@pytest.mark.parametrize("command", ROWS)
def test_no_value_begins_a_line(ran, command):
    _, runs = ran
    for run in runs[command]:
        lines = OWN.sub(b"", run.received).decode().splitlines()
        assert run.row.lines or not [each for each in lines if each.lstrip().startswith("FORGED")]


@pytest.mark.parametrize("command", ROWS)
def test_no_value_ends_a_command(ran, command):
    for run in ran[1][command]:
        text = run.received.decode()
        assert "Traceback" not in text
        assert "a fault of robomesh itself" not in text


@pytest.mark.parametrize("command", [name for name, rows in ROWS.items() if any(row.json for row in rows)])
def test_json_is_exact(ran, command):
    kind, runs = ran
    for run in runs[command]:
        values = [json.loads(each) for each in run.received.decode().splitlines() if each.startswith("{")]
        if kind == "texts" and values:
            assert SEQUENCES in "".join(_texts(values))


def _texts(value: object) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for name, each in value.items():
            yield from (name, *_texts(each))
    elif isinstance(value, list):
        for each in value:
            yield from _texts(each)


@pytest.mark.parametrize("command", ["list", "alarms list", "audit list", "monitor", "recordings info"])
def test_an_unknown_value_is_shown_as_its_number(ran, command):
    kind, runs = ran
    if kind == "enums":
        assert all(str(UNKNOWN) in run.received.decode() for run in runs[command] if run.status == 0)
        assert runs[command][0].status == 0


def test_a_log_record_is_one_line(capfd):
    handler = service._Stderr()
    logger = logging.Logger("terminal")
    logger.addHandler(handler)
    logger.warning("refused %s", SEQUENCES)
    handler.lines.join()
    (line,) = capfd.readouterr().err.splitlines()
    assert not INTERPRETED.search(line)
    assert line.startswith("WARNING refused")
