"""Texts and JSON values of `robomesh monitor` besides the joints."""

import asyncio
import json

import pytest
from google.protobuf.timestamp_pb2 import Timestamp

from robomesh.schemas.robomesh_pb2 import (
    Clearance,
    ControllerState,
    Description,
    KinematicState,
    ProgramState,
)
from robomesh.wire.session import open_session
from services.command_line.watch import monitor
from services.command_line.watch.monitor_text import (
    check_words,
    clearance_record,
    near_words,
    program_record,
    program_words,
)
from tests.robomesh.test_session import joints

ARM = Description(warning_distance=0.05, stop_distance=0.01)


def near(distance):
    return KinematicState(
        clearance=Clearance(distance=distance, first="hall/arm/flange", second="hall/mate/wrist"),
        own_clearance=Clearance(distance=0.1, first="hall/arm/base", second="hall/arm/flange"),
        not_counted=["third"],
    )


@pytest.mark.parametrize(
    ("distance", "text", "style"),
    [
        (0.2, "200.0 mm", ""),
        (0.0499, "49.9 mm", "bold yellow"),
        (0.0099, "9.9 mm", "bold red"),
        (0.0, "touching", "bold red"),
    ],
)
def test_clearances_are_printed_with_their_pair_and_a_style_by_distance(distance, text, style):
    clearance, own, missing = near_words(near(distance), ARM, "hall/arm")
    assert clearance == (f"clearance {text} (flange - mate wrist)", style)
    assert own == ("own links 100.0 mm (base - flange)", "")
    assert missing == ("not counted, at unknown positions: third", "bold yellow")


def test_an_unavailable_check_is_printed_with_its_effect_on_motions():
    assert check_words(ControllerState()) is None
    assert check_words(ControllerState(check=ControllerState.REQUIRE)) == (
        "motions: checked, refused unless free",
        "",
    )
    cannot = ControllerState(check=ControllerState.REQUIRE, check_text="no collision meshes")
    assert check_words(cannot) == ("motions: refused now: no collision meshes", "bold yellow")
    cannot.check = ControllerState.WARN
    assert check_words(cannot) == ("motions: not checked now: no collision meshes", "bold yellow")


def test_a_program_is_printed_with_step_line_time_and_outcome():
    assert program_words(ProgramState()) is None
    state = ProgramState(
        outcome=ProgramState.RUNNING,
        name="weld",
        operator="li",
        since=Timestamp(seconds=100),
        timestamp=Timestamp(seconds=172, nanos=900_000_000),
        line=7,
        statement="move_line part",
        step=12,
        steps=40,
        duration_s=125.5,
        left_s=52.6,
    )
    text = "program weld: step 12 of 40, line 7: move_line part; by li, for 01:12, 00:53 left"
    assert program_words(state) == (text, "bold")
    assert program_words(state, stale=True) == (text, "dim strike")
    state.outcome, state.text = ProgramState.ENDED, "stopped by wang"
    assert program_words(state) == (
        "program weld, by li: ended at line 7: move_line part: stopped by wang",
        "bold yellow",
    )
    state.outcome = ProgramState.DONE
    assert program_words(state) == ("program weld: done, by li", "")
    assert program_record(state) == {
        "outcome": "done",
        "name": "weld",
        "operator": "li",
        "line": 7,
        "step": 12,
        "steps": 40,
        "text": "stopped by wang",
    }


def test_json_has_clearance_and_program_or_null():
    assert clearance_record(near(0.25), "hall/arm") == {
        "distance_m": 0.25,
        "pair": ["arm/flange", "mate/wrist"],
    }
    assert clearance_record(KinematicState(), "hall/arm") is None
    assert clearance_record(None, "hall/arm") is None
    assert program_record(ProgramState()) is None
    assert program_record(None) is None


async def test_a_count_is_of_live_states_only(mesh, capsys):
    async with open_session(mesh) as gateway:
        gateway.declare_presence("hall", "arm", "gateway")
        publisher = gateway.declare_publisher("hall", "arm", "joints")
        publisher.put(joints(1.0))
        watching = asyncio.create_task(monitor._json("hall/arm", mesh.connect[0], 2))
        while not watching.done():
            publisher.put(joints(2.0))
            await asyncio.sleep(0.05)
        await watching
    rows = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [row["live"] for row in rows] == [True, True]
